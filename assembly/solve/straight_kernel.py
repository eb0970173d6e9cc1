"""A solve that goes on from a solution in one compiled call, whose arrays but for the state are lent."""

from __future__ import annotations

from assembly._address import call_address
from assembly._kernel import kernel
from assembly._lent import lent_array
from assembly._record import record_dtype, record_view

# Rows of the table of lent arrays: what `solve_program` takes but the state, in its order; a record of `ORDERS`; pairs
# of places of driven angles: where a state looks for an angle, and where the pool has its value.
SETTINGS_ROW, ORDERS_ROW, ANGLES_ROW = 2, 6, 7
ORDERS = record_dtype(
    "i8",
    loop=1,  # the address of `solve_program`
    count_at=1,  # where a state has the number of its iterations
    iterations=1,  # that number, at the end
)
orders_at = record_view(ORDERS)
integers, doubles = lent_array("i8", 1), lent_array("f8", 1)
integer_rows, double_rows = lent_array("i8", 2), lent_array("f8", 2)


@kernel(signatures=("(i8[:, ::1], f8[::1], i8)", "(i8[:, ::1], f8[::1], none)"))
def run_straight(lent, state, end_effectors):
    """Have angles start at their driven values, and run the loop on a state. Returns how it ended.

    `end_effectors` is what `solve_program` takes.
    """
    orders, pool, angles = orders_at(integers(lent, ORDERS_ROW), 0), doubles(lent, 1), integer_rows(lent, ANGLES_ROW)
    for k in range(angles.shape[0]):
        state[angles[k, 0]] = pool[angles[k, 1]]
    table, settings, history = integers(lent, 0), doubles(lent, SETTINGS_ROW), double_rows(lent, 3)
    block, integer_block = doubles(lent, 4), integers(lent, 5)
    code = call_address(orders.loop, (table, pool, settings, state, history, block, integer_block, end_effectors))
    orders.iterations = int(state[orders.count_at])
    return code
