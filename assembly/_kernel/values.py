"""A builder of code for LLVM that keeps values as values, instead of writing them to memory and reading them again.

Numba takes a tuple apart for every call and puts it together in what is called, stores it in a slot of memory, loads
it, and takes it apart again for its parts. LLVM's first simplification undoes all of it: six of seven instructions are
gone then. Here most are not written: a part of a value that was put together is what was put there, what is loaded from
a slot is what was stored last in the same block, and what nobody uses is left out at the end.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from typing import Any

from llvmlite import ir
from llvmlite.ir import instructions

__all__ = ["ValueBuilder"]

Path = tuple[int, ...]
# Instructions without effects, which may be left out where nobody uses them.
_PURE = frozenset(
    (
        *(instructions.ExtractValue, instructions.InsertValue, instructions.LoadInstr, instructions.GEPInstr),
        *(instructions.CastInstr, instructions.ICMPInstr, instructions.FCMPInstr, instructions.SelectInstr),
    )
)


@dataclass
class _Slot:
    """A slot of memory, and what is in it at the end of a block.

    Attributes
    ----------
    block
        The block at whose end it is known.
    whole
        What was stored in it as a whole, if that is known.
    parts
        What was stored in parts of it since, by their places.
    is_open
        Whether something but loads and stores uses its address.
    """

    block: Any = None
    whole: Any = None
    parts: dict[Path, Any] = field(default_factory=dict)
    is_open: bool = False

    def begin(self, block: Any, whole: Any = None) -> None:
        """Know this alone, in this block."""
        self.block, self.whole, self.parts = block, whole, {}

    def put(self, block: Any, path: Path, value: Any) -> None:
        """Know what is in a part, from now on in this block."""
        if not path:
            self.begin(block, value)
            return
        if self.block is not block:
            self.begin(block)
        for other in list(self.parts):
            if other[: len(path)] == path:
                del self.parts[other]
            elif path[: len(other)] == other:
                # A part of a part: what is beside it is not known any more.
                del self.parts[other]
                self.whole = None
        self.parts[path] = value


class ValueBuilder(ir.IRBuilder):
    """The builder of one function; `finish` has to be called when all of it is written."""

    def __init__(self, block: Any) -> None:
        super().__init__(block)
        # What addresses point to, and parts of values, which stand right after these.
        self._places: dict[Any, tuple[_Slot, Path]] = {}
        self._parts: dict[Any, dict[int, Any]] = {}

    def extract_value(self, agg: Any, idx: Any, name: str = "") -> Any:
        """The part of a value."""
        for index in idx if isinstance(idx, (tuple, list)) else (idx,):
            agg = self._part(agg, index, name)
        return agg

    def _part(self, whole: Any, index: int, name: str) -> Any:
        while type(whole) is instructions.InsertValue and len(whole.indices) == 1:
            if whole.indices[0] == index:
                return whole.value
            whole = whole.aggregate
        if isinstance(whole, ir.Constant) and (whole.constant is None or whole.constant is ir.Undefined):
            return ir.Constant(whole.type.elements[index], whole.constant)
        if not isinstance(whole, instructions.Instruction):
            return super().extract_value(whole, index, name)
        parts = self._parts.setdefault(whole, {})
        if index not in parts:
            parts[index] = instructions.ExtractValue(whole.parent, whole, [index], name)
        return parts[index]

    def alloca(self, typ: Any, size: Any = None, name: str = "") -> Any:
        """A slot of memory."""
        address = super().alloca(typ, size, name)
        if size is None:
            self._places[address] = _Slot(), ()
        return address

    def load(self, ptr: Any, name: str = "", align: Any = None, typ: Any = None) -> Any:
        """What is at an address."""
        slot, path = self._places.get(ptr, (None, ()))
        if slot is None or slot.is_open:
            return super().load(ptr, name, align, typ)
        value = self._known(slot, path) if slot.block is self.block else None
        if value is None or value.type != ptr.type.pointee:
            value = super().load(ptr, name, align, typ)
            slot.put(self.block, path, value)
        return value

    def _known(self, slot: _Slot, path: Path) -> Any:
        """What is in a part of a slot, if that is known."""
        for length in range(len(path), 0, -1):
            if path[:length] in slot.parts:
                return self.extract_value(slot.parts[path[:length]], path[length:])
        inside = [other for other in slot.parts if other[: len(path)] == path]
        if slot.whole is None or any(len(other) != len(path) + 1 for other in inside):
            return None
        value = self.extract_value(slot.whole, path)
        for other in inside:
            value = self.insert_value(value, slot.parts[other], other[-1])
        return value

    def store(self, value: Any, ptr: Any, align: Any = None) -> Any:
        """Store a value at an address."""
        done = super().store(value, ptr, align)
        slot, path = self._places.get(ptr, (None, ()))
        if slot is not None:
            slot.put(self.block, path, value)
        return done

    def _insert(self, instr: Any) -> None:
        super()._insert(instr)
        kind = type(instr)
        if kind is instructions.LoadInstr:
            return
        if kind is instructions.GEPInstr and self._goes_inside(instr):
            return
        self._open(instr.operands[:1] if kind is instructions.StoreInstr else instr.operands)

    def _open(self, used: Iterable[Any]) -> None:
        """Slots whose addresses are used otherwise than to load and to store are memory."""
        for value in used:
            if isinstance(value, instructions.Instruction) and value in self._places:
                self._places[value][0].is_open = True

    def _goes_inside(self, address: Any) -> bool:
        """Whether an address is that of a part of a slot, by constants; if so it is remembered."""
        slot, path = self._places.get(address.pointer, (None, ()))
        indices: list[Any] = [index.constant if isinstance(index, ir.Constant) else None for index in address.indices]
        if slot is None or indices[0] != 0 or None in indices:
            return False
        self._places[address] = slot, (*path, *indices[1:])
        return True

    def finish(self) -> None:
        """Put parts behind their values, and leave out what nobody uses."""
        blocks = self.function.blocks
        for block in blocks:
            block.instructions = list(self._with_parts(block.instructions))
            for phi in (instr for instr in block.instructions if type(instr) is instructions.PhiInstr):
                self._open(value for value, _block in phi.incomings)
        uses: dict[Any, int] = {}
        for block in blocks:
            for instr in block.instructions:
                for operand in _operands(instr):
                    uses[operand] = uses.get(operand, 0) + 1
        _leave_out_unused(blocks, uses)
        self._leave_out_unread(blocks, uses)
        _leave_out_unused(blocks, uses)

    def _with_parts(self, written: list[Any]) -> Iterator[Any]:
        waiting: list[Any] = []
        for instr in written:
            if waiting and type(instr) is not instructions.PhiInstr:
                yield from waiting
                waiting = []
            yield instr
            found = list(self._all_parts(instr))
            if type(instr) is instructions.PhiInstr:
                waiting += found
            else:
                yield from found

    def _all_parts(self, whole: Any) -> Iterator[Any]:
        for part in self._parts.get(whole, {}).values():
            yield part
            yield from self._all_parts(part)

    def _leave_out_unread(self, blocks: list[Any], uses: dict[Any, int]) -> None:
        """Leave out slots from which nothing is loaded, with all that is stored there."""
        loads = (i for block in blocks for i in block.instructions if type(i) is instructions.LoadInstr)
        read = {id(self._places[i.operands[0]][0]) for i in loads if i.operands[0] in self._places}
        unread = {at for at, (slot, _path) in self._places.items() if not slot.is_open and id(slot) not in read}
        for block in blocks:
            kept = []
            for instr in block.instructions:
                if instr in unread or (type(instr) is instructions.StoreInstr and instr.operands[1] in unread):
                    _forget(instr, uses)
                else:
                    kept.append(instr)
            block.instructions = kept


def _operands(instr: Any) -> list[Any]:
    """The instructions and arguments that an instruction uses."""
    if type(instr) is instructions.PhiInstr:
        given = [value for value, _block in instr.incomings]
    else:
        given = instr.operands
    return [value for value in given if isinstance(value, instructions.Instruction)]


def _forget(instr: Any, uses: dict[Any, int]) -> None:
    for operand in _operands(instr):
        uses[operand] -= 1


def _leave_out_unused(blocks: list[Any], uses: dict[Any, int]) -> None:
    """Leave out instructions without effects whose values nobody uses."""
    for block in reversed(blocks):
        kept = []
        for instr in reversed(block.instructions):
            if type(instr) in _PURE and not uses.get(instr):
                _forget(instr, uses)
            else:
                kept.append(instr)
        block.instructions = kept[::-1]
