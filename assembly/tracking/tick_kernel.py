"""A tick in one compiled call: the loop, and the proof that bodies stay clear on the way to where it led."""

from __future__ import annotations

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._lent import lent_array
from assembly._record import record_dtype, record_view
from assembly.proximity.clearance.pair_looks import ON_WAY
from assembly.solve.loop.settings import results_at

# How the proof ended if it was not asked; else as looks end (`proximity/clearance/records.py`).
NOT_ASKED = -1
# Rows of the table of arrays that are lent: what `solve_program` takes, from its table to its integers; a record of
# ORDERS and one of LENGTHS; poses and results, which are parts of the state; the table of a proof and what opens
# contacts, as `stay_clear` takes them.
ORDERS_ROW, LENGTHS_ROW, POSES_ROW, RESULTS_ROW, PROOF_ROW, MOVES_ROW = 7, 8, 9, 10, 11, 12
ORDERS = record_dtype(
    "i8",
    loop=1,  # the address of `solve_program`
    proof=1,  # that of `stay_clear`
    proves=1,  # 1: the proof is asked where constraints hold
    budget=1,  # of pairs of nodes of each pair of bodies
    clock=1,  # the address of a clock
    until=1,  # when the time of the proof is over [ns]; 0: never
    found=1,  # how the proof ended, or NOT_ASKED
)
orders_at = record_view(ORDERS)
LENGTHS = record_dtype(
    "f8",
    tolerance=1,  # the largest violation at which constraints hold
    touching=1,  # what bodies may be in each other and touch
)
lengths_at = record_view(LENGTHS)
integers, doubles = lent_array("i8", 1), lent_array("f8", 1)
integer_rows, double_rows = lent_array("i8", 2), lent_array("f8", 2)


@kernel(signatures=("(i8[:, ::1], i8)", "(i8[:, ::1], none)"))
def run_tick(lent, end_effectors):
    """Run the loop, and prove its pose and the way there where it led to one at which constraints hold.

    `end_effectors` is what `solve_program` takes. Returns how the loop ended.
    """
    orders, lengths = orders_at(integers(lent, ORDERS_ROW), 0), lengths_at(doubles(lent, LENGTHS_ROW), 0)
    table, pool, settings, state = integers(lent, 0), doubles(lent, 1), doubles(lent, 2), doubles(lent, 3)
    history, block, integer_block = double_rows(lent, 4), doubles(lent, 5), integers(lent, 6)
    code = call_address(orders.loop, (table, pool, settings, state, history, block, integer_block, end_effectors))
    orders.found = NOT_ASKED
    result = results_at(doubles(lent, RESULTS_ROW), 0)
    if orders.proves == 1 and result.carried == 0.0 and result.violation <= lengths.tolerance:
        q, moves = double_rows(lent, POSES_ROW), double_rows(lent, MOVES_ROW)
        asked, time = (ON_WAY, orders.budget), (orders.clock, orders.until)
        arguments = (integer_rows(lent, PROOF_ROW), q, moves, lengths.touching, asked, time)
        orders.found = call_address(orders.proof, arguments)
    return code
