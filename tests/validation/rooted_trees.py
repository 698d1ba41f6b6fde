"""Rooted trees, and the conditions that they put on a Runge-Kutta tableau (Butcher 1963).

A scheme has order p if and only if for every tree t of at most p nodes its elementary weight is `1 / gamma(t)`.
"""

import functools
import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from airrace.optimal_control.runge_kutta import RungeKutta

Tree = tuple["Tree", ...]  # of the branches at its root, sorted; a single node has none


@dataclass(frozen=True)
class Tableau:
    """Weights of a whole interval: `A` (s, s) and `b` (s,)."""

    A: NDArray[np.float64]
    b: NDArray[np.float64]


def tableau(scheme: RungeKutta) -> Tableau:
    """Of all steps of an interval, taken as one."""
    stages, steps = len(scheme.b), scheme.steps
    own = np.array([[*row, *[0.0] * (stages - len(row))] for row in scheme.a])
    A = np.zeros((stages * steps, stages * steps))
    for step in range(steps):
        rows = slice(step * stages, (step + 1) * stages)
        A[rows, rows] = own / steps
        A[rows, : step * stages] = np.tile(np.array(scheme.b) / steps, step)
    return Tableau(A, np.tile(np.array(scheme.b) / steps, steps))


@functools.cache
def trees(nodes: int) -> tuple[Tree, ...]:
    """All rooted trees with this many nodes."""
    if nodes == 1:
        return ((),)
    # a node more is a leaf more, somewhere
    return tuple(sorted({grown for tree in trees(nodes - 1) for grown in with_a_leaf(tree)}))


def with_a_leaf(tree: Tree) -> set[Tree]:
    """The tree with one leaf more, at any of its nodes."""
    grown = {tuple(sorted((*tree, ())))}
    for index, branch in enumerate(tree):
        others = tree[:index] + tree[index + 1 :]
        grown |= {tuple(sorted((*others, larger))) for larger in with_a_leaf(branch)}
    return grown


def size(tree: Tree) -> int:
    """Number of nodes."""
    return 1 + sum(size(branch) for branch in tree)


def gamma(tree: Tree) -> int:
    """The tree's density: the product of the sizes of all its subtrees."""
    return size(tree) * math.prod(gamma(branch) for branch in tree)


def elementary_weight(scheme: Tableau, tree: Tree) -> float:
    """What the scheme makes of the tree's elementary differential."""
    return float(scheme.b @ _at_stages(scheme, tree))


def _at_stages(scheme: Tableau, tree: Tree) -> NDArray[np.float64]:
    product = np.ones(len(scheme.b))
    for branch in tree:
        product = product * (scheme.A @ _at_stages(scheme, branch))
    return product


def violation(scheme: RungeKutta, nodes: int) -> float:
    """By how much the worst of the conditions of this order is missed."""
    weights = tableau(scheme)
    return max(abs(elementary_weight(weights, tree) - 1 / gamma(tree)) for tree in trees(nodes))
