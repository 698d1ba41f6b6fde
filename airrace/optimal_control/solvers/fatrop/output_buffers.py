"""The matrices that fatrop hands over to be filled: where they lie, and where their last rows go."""

from collections.abc import Sequence

from airrace.optimal_control.layout import Indices
from airrace.optimal_control.solvers.fatrop.matrices import MatrixFamily, memory_of
from airrace.optimal_control.solvers.fatrop.stages import Rows, Stages
from airrace.optimal_control.stage_assembly import Memory


class OutputBuffers:
    """The matrices of one solve. fatrop has a few sets of them and uses them in turn.

    When a set is met first, zero is written to all of its entries; those that no pattern holds stay so.
    """

    def __init__(self, stages: Stages, rows: Rows) -> None:
        self._stages = stages
        self._rows = rows
        self._known: dict[bytes, tuple[Memory, Indices]] = {}

    def constraints(self, structs: Sequence[int]) -> tuple[Memory, Indices]:
        """Return the memory of the matrices BAbt and both Ggt, and the places of the residuals in it.

        Args:
            structs: the addresses of the three arrays of structs.

        Raises:
            SolverCrash: the matrices have other shapes.
        """
        rows, columns = self._rows, self._rows.columns
        key, addresses = _addresses(rows.families, structs)
        if key not in self._known:
            memory = _cleared(rows.families, addresses)
            begins = memory.begins[columns.stages, columns.families]
            bounded, offsets = rows.constants
            memory.doubles[begins[bounded] + offsets] = rows.factors[bounded]
            self._known[key] = memory, begins + rows.residual_offsets
        return self._known[key]

    def costs(self, structs: int) -> tuple[Memory, Indices]:
        """Return the memory of the matrices RSQrqt, and the places of the gradient in it; otherwise the same."""
        stages = self._stages
        key, addresses = _addresses((stages.matrices,), (structs,))
        if key not in self._known:
            memory = _cleared((stages.matrices,), addresses)
            self._known[key] = memory, memory.begins[stages.stage_of_unknown, 0] + stages.gradient_offsets
        return self._known[key]


def _addresses(families: Sequence[MatrixFamily], structs: Sequence[int]) -> tuple[bytes, Sequence[Indices]]:
    """Return the addresses of all matrices, and what tells them from other ones."""
    addresses = [family.addresses(address) for family, address in zip(families, structs, strict=True)]
    return b"".join(one.tobytes() for one in addresses), addresses


def _cleared(families: Sequence[MatrixFamily], addresses: Sequence[Indices]) -> Memory:
    """Return the memory of these matrices, whose entries are zero now."""
    memory = memory_of(families, addresses)
    for number, family in enumerate(families):
        family.clear(memory.doubles, memory.begins[: len(family.rows), number])
    return memory
