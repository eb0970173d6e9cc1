"""How kernels are compiled and linked, and what Numba is told of them."""

from __future__ import annotations

from tests.kernels.small_package import CALL

AT = """
@kernel
def at(values, index):
    return values[index]
"""
# Prints the answer, how often it was found on disk and compiled, and where the cache is.


def test_an_index_is_taken_as_it_stands_in_the_package_alone(package):
    package.edit("callee.py", "from small._kernel import kernel", "from small._kernel import kernel\n" + AT)
    code = """
import numpy as np
from numba import njit
from small.callee import at
@njit
def elsewhere(values, index):
    return values[index]
values = np.array([1.0, 2.0, 3.0])
print(at(values, 2), elsewhere(values, -1), sep="|", end="|")
try:
    at(values, -1)
except IndexError:
    print("IndexError")
"""
    # Without the check, what an index of -1 reads is not defined.
    assert package.run(code, NUMBA_BOUNDSCHECK="1").startswith("3.0|3.0|IndexError\n")


def test_what_is_found_on_disk_needs_no_word_to_numba(compiled):
    code = (
        CALL + "from small._kernel.overloads import _WAITING\nprint([function.__name__ for function, _ in _WAITING])\n"
    )
    assert compiled.run(code).splitlines()[-1] == "['helper']"


def test_a_kernel_links_to_one_that_was_found_on_disk(compiled):
    code = """
from small._kernel import kernel
from small.callee import helper, inner
assert inner(1.0) == 2.0 and inner.stats.cache_hits.total() == 1
@kernel
def mine(x):
    return helper(inner(x)) + 1.0
print(mine(1.0), inner.stats.cache_misses.total())
"""
    assert compiled.run(code).splitlines()[-1] == "3.0 0"


def test_a_kernel_tied_to_this_process_is_not_cached(package):
    # Numba passes an array of more than a megabyte by its address.
    package.edit("caller.py", "@kernel\ndef outer", "import numpy as np\nTABLE = np.ones(200_000)\n@kernel\ndef outer")
    package.edit("caller.py", "FACTOR *", "FACTOR * TABLE[int(x)] *")
    for _ in range(2):
        output = package.run()
        assert output.startswith("8.0|0|1|")
        assert "outer uses an address or a large global array and is not cached" in output


# Whatever calls an inner kernel: a user's function, one of those that an entry calls, a function of Numba's.
AROUND = """
from numba import njit
from small._kernel import kernel
from small._kernel.overloads import make_callable
from small.nested import inside, outside
make_callable()
@njit
def mine(x):
    return outside(x) + 1.0
@kernel
def through_mine(x):
    return -mine(x)
@kernel
def mapped(n):
    total = 0.0
    for y in map(outside, range(n)):
        total += y
    return total
print(through_mine(3.0), mapped(3), mine(3.0))
"""


def test_an_inner_kernel_can_be_called_by_others_than_entries(package):
    (package.folder / "nested.py").write_text("""
from small._kernel import kernel
@kernel(inner=True)
def inside(x):
    return x + 1.0
@kernel(inner=True)
def outside(x):
    return inside(x) * 2.0
""")
    assert package.run(AROUND).splitlines()[0] == "-9.0 12.0 9.0"


def test_what_is_changed_to_compile_is_changed_back(package):
    code = """
import gc
from numba.core import event
from small._kernel import kernel
from small.caller import outer
@kernel
def broken(x):
    return x.nothing
timer = event.install_timer
outer(1.0)
print(gc.isenabled(), event.install_timer is timer)
try:
    broken(1.0)
except Exception:
    print(gc.isenabled(), event.install_timer is timer)
gc.disable()
outer(1)
print(gc.isenabled())
"""
    assert package.run(code).split()[:5] == ["True", "True", "True", "True", "False"]


def test_what_an_entry_calls_is_linked_as_its_own(package):
    # As it is before LLVM copies small functions into their callers.
    code = """
from numba.core.codegen import CPUCodeLibrary
optimize = CPUCodeLibrary._optimize_final_module
seen = []
def look(library):
    seen.append({f.name: f.linkage.name for f in library.get_defined_functions()})
    optimize(library)
CPUCodeLibrary._optimize_final_module = look
from small.caller import outer
outer(3.0)
(compiled,) = outer.overloads.values()
names = compiled.fndesc
own = {names.llvm_func_name, names.llvm_cpython_wrapper_name, names.llvm_cfunc_wrapper_name}
print({seen[-1][name] for name in own}, {kind for name, kind in seen[-1].items() if name not in own})
"""
    assert package.run(code).splitlines()[0] == "{'external'} {'internal'}"


ORDERS = """
from llvmlite.binding import ObjectFileRef
from small import nested
for name in {order!r}:
    getattr(nested, name).compile("(f8[::1],)")
(compiled,) = nested.twice.overloads.values()
code = ObjectFileRef.from_data(compiled.library._get_compiled_object())
texts = (b".text", b".ltext", b"__text")
print("".join(section.data().hex() for section in code.sections() if section.name() in texts))
"""


def test_an_entry_is_the_same_code_whatever_was_compiled_before_it(package):
    # What `summed` is compiled for first would have it copied into its callers; it is too long for LLVM to do so.
    many = "".join(f"            total += values[k] ** {power} / (values[l] + total)\n" for power in range(2, 40))
    (package.folder / "nested.py").write_text(f"""
from small._kernel import kernel
@kernel
def summed(values):
    total = 0.0
    for k in range(values.size):
        for l in range(k):
{many}    return total
@kernel(inline=True)
def copied(values):
    return summed(values) + 1.0
@kernel
def once(values):
    return copied(values)
@kernel
def twice(values):
    return summed(values) * summed(values[1:])
""")
    code = {
        package.run(ORDERS.format(order=order), NUMBA_CACHE_DIR=str(package.folder / "-".join(order)))
        for order in (("twice",), ("once", "twice"), ("summed", "twice"))
    }
    assert len(code) == 1 and len(code.pop()) > 100
