"""Like terms collected: the same function with fewer multiplications where many inputs are known early.

Each sum of products becomes coefficients, which a rollout computes once, of monomials of velocities; common factors are
taken out, as by Horner's rule. The result differs by rounding alone.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping
from functools import lru_cache

import casadi as ca

from shipid.engine.graph import InstructionGraph, apply_operation
from shipid.engine.tables import inside_tables

FEW = 2  # terms of a sum that is multiplied out
Monomial = tuple[int, ...]  # numbers of atoms, rising; () is the number 1


@lru_cache(maxsize=64)
def collect_terms(function: ca.Function, early: frozenset[str]) -> ca.Function:
    """An SX function of the same inputs and output; `early` are the names of the inputs that are known early.

    Tables stay as they are written, so that they can be looked up.
    """
    return _Collector(function, early).function()


class _CollectedSum:
    """Coefficients, which are known early, of monomials of atoms: what is neither a sum nor a product."""

    def __init__(self, terms: Mapping[Monomial, ca.SX]) -> None:
        self.terms = {monomial: value for monomial, value in terms.items() if not value.is_zero()}

    @property
    def early(self) -> bool:
        """Whether it has no atoms."""
        return not any(self.terms)

    @property
    def constant(self) -> ca.SX:
        """The coefficient of 1."""
        return self.terms.get((), ca.SX(0))

    @property
    def late(self) -> dict[Monomial, ca.SX]:
        """The terms with atoms."""
        return {monomial: value for monomial, value in self.terms.items() if monomial}

    @property
    def plain(self) -> bool:
        """Whether it adds or subtracts two values or more as they are: multiplied out, it would lose digits."""
        return len(self.terms) > 1 and all(_is_unit(value) for value in self.late.values())


def _is_unit(value: ca.SX) -> bool:
    return bool(value.is_constant() and abs(float(value)) == 1)


class _Collector:
    """Walks the instructions of a function, and keeps of each a sum; writes out those that others need as a value."""

    def __init__(self, function: ca.Function, early: frozenset[str]) -> None:
        self.given, self.graph = function, InstructionGraph(function)
        self.inputs = [ca.SX.sym(function.name_in(i), function.sparsity_in(i)) for i in range(function.n_in())]
        self.early = early
        self.uses = Counter(operand for operands in self.graph.operands for operand in operands)
        self.literal = inside_tables(function)
        self.atoms: list[ca.SX] = []
        self.sums: dict[int, _CollectedSum] = {}
        self.written: dict[int, ca.SX] = {}  # of instructions
        self.products: dict[Monomial, ca.SX] = {}
        # products of coefficients, after these, by their places in memory: which must stay theirs
        self.scaled: dict[tuple[int, int], tuple[ca.SX, ca.SX, ca.SX]] = {}

    def function(self) -> ca.Function:
        """The function with its terms collected."""
        out = ca.SX(self.given.sparsity_out(0))
        for k, operation in enumerate(self.graph.operation):
            if operation == ca.OP_OUTPUT:
                out.nz[self.given.instruction_output(k)[1]] = self.value(self.graph.operands[k][0])
            else:
                self.sums[k] = self.instruction(k, operation)
        names = self.given.name_in(), self.given.name_out()
        return ca.Function(self.given.name(), self.inputs, [out], *names)

    def instruction(self, k: int, operation: int) -> _CollectedSum:
        """What an instruction gives; a sum that several others use is an atom."""
        if operation == ca.OP_CONST:
            return _CollectedSum({(): ca.SX(self.given.instruction_constant(k))})
        if operation == ca.OP_INPUT:
            source, entry = self.given.instruction_input(k)
            value = self.inputs[source].nz[entry]
            return _CollectedSum({(): value}) if self.given.name_in(source) in self.early else self.atom(value)
        operands = self.graph.operands[k]
        if all(self.sums[i].early for i in operands):
            return _CollectedSum({(): apply_operation(operation, [self.sums[i].constant for i in operands])})
        made = None if k in self.literal else self.combined(operation, operands)
        if made is None:
            return self.atom(apply_operation(operation, [self.value(i) for i in operands]))
        return made if self.uses[k] < 2 or len(made.terms) < 2 else self.atom(self.expression(made.terms))

    def combined(self, operation: int, operands: tuple[int, ...]) -> _CollectedSum | None:
        """A sum or product of sums; None for another operation."""
        a, b = self.sums[operands[0]], self.sums[operands[-1]]
        if operation in (ca.OP_ADD, ca.OP_SUB):
            terms = dict(a.terms)
            for monomial, value in b.terms.items():
                signed = -value if operation == ca.OP_SUB else value
                terms[monomial] = terms[monomial] + signed if monomial in terms else signed
            return _CollectedSum(terms)
        if operation in (ca.OP_NEG, ca.OP_TWICE):
            return self.times(operands[0], ca.SX(-1 if operation == ca.OP_NEG else 2))
        if operation == ca.OP_DIV and b.early:
            return self.times(operands[0], 1 / b.constant)
        if operation == ca.OP_MUL and (a.early or b.early):
            return self.times(operands[0], b.constant) if b.early else self.times(operands[1], a.constant)
        if operation in (ca.OP_MUL, ca.OP_SQ):
            return self.product(operands[0], operands[-1])
        return None

    def times(self, k: int, factor: ca.SX) -> _CollectedSum:
        """A sum by what is known early; a long one, or one without products, is an atom by it."""
        of = self.sums[k]
        if not _is_unit(factor) and (of.plain or len(of.late) > FEW):
            of = self.as_atom(k)
        return _CollectedSum({monomial: self.by(value, factor) for monomial, value in of.terms.items()})

    def product(self, first: int, second: int) -> _CollectedSum:
        """The product of two sums: a short one by a single term is multiplied out, else sums are atoms."""
        a, b = self.sums[first], self.sums[second]
        if first == second or (len(a.terms) > 1 and len(b.terms) > 1):
            a, b = (of if len(of.terms) == 1 else self.as_atom(k) for of, k in ((a, first), (b, second)))
        elif len(a.terms) > 1 and (a.plain or len(a.terms) > FEW):
            a = self.as_atom(first)
        elif len(b.terms) > 1 and (b.plain or len(b.terms) > FEW):
            b = self.as_atom(second)
        terms: dict[Monomial, ca.SX] = {}
        for left, x in a.terms.items():
            for right, y in b.terms.items():
                monomial, value = tuple(sorted(left + right)), self.by(x, y)
                terms[monomial] = terms[monomial] + value if monomial in terms else value
        return _CollectedSum(terms)

    def by(self, x: ca.SX, y: ca.SX) -> ca.SX:
        """The product of two coefficients, the same expression each time."""
        key = x.element_hash(), y.element_hash()
        if key not in self.scaled:
            self.scaled[key] = x, y, x * y
        return self.scaled[key][2]

    def atom(self, value: ca.SX) -> _CollectedSum:
        """A new atom."""
        self.atoms.append(value)
        return _CollectedSum({(len(self.atoms) - 1,): ca.SX(1)})

    def as_atom(self, k: int) -> _CollectedSum:
        """What an instruction gives as one atom, for all who use it from now on."""
        if not self.is_atom(k):
            self.sums[k] = self.atom(self.value(k))
        return self.sums[k]

    def is_atom(self, k: int) -> bool:
        """Whether an instruction gives one atom as it is."""
        terms = self.sums[k].terms
        return len(terms) == 1 and all(len(monomial) == 1 and value.is_one() for monomial, value in terms.items())

    def value(self, k: int) -> ca.SX:
        """What an instruction gives as an expression, written once."""
        if k not in self.written:
            self.written[k] = self.expression(self.sums[k].terms)
        return self.written[k]

    def expression(self, terms: Mapping[Monomial, ca.SX]) -> ca.SX:
        """A sum written out: the factor that most of its terms have is taken out, and so on with what is left."""
        counts = Counter(atom for monomial in terms for atom in set(monomial))
        factor, count = max(counts.items(), key=lambda item: (item[1], -item[0]), default=(0, 0))
        if count < 2:
            result = ca.SX(0)
            for monomial, value in terms.items():
                result += value * self.monomial(monomial) if monomial else value
            return result
        inner, rest = {}, {}
        for monomial, value in terms.items():
            if factor in monomial:
                place = monomial.index(factor)
                inner[monomial[:place] + monomial[place + 1 :]] = value
            else:
                rest[monomial] = value
        product = self.atoms[factor] * self.expression(inner)
        return self.expression(rest) + product if rest else product

    def monomial(self, atoms: Monomial) -> ca.SX:
        """A product of atoms, the same expression each time."""
        if len(atoms) == 1:
            return self.atoms[atoms[0]]
        if atoms not in self.products:
            self.products[atoms] = self.monomial(atoms[:-1]) * self.atoms[atoms[-1]]
        return self.products[atoms]
