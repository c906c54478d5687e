"""Where a likelihood has fallen by a given amount, going from its maximum to one side: the end of an interval."""

from __future__ import annotations

from collections.abc import Callable


def reach(
    fallen: Callable[[float], bool], first: float, most: float, halvings: int = 5
) -> tuple[float, float]:
    """Return two distances between which a likelihood falls, 2^−halvings of the second apart; `most` where it does not.

    Parameters
    ----------
    fallen : callable
        Whether it has at a distance.
    first : float
        A guess, which is doubled until it has.
    most : float
        The largest distance.
    halvings : int
        Bisections that follow.
    """
    near, far = 0.0, min(first, most)
    while not fallen(far):
        if far >= most:
            return most, most
        near, far = far, min(2.0 * far, most)
    for _ in range(halvings):
        middle = 0.5 * (near + far)
        near, far = (near, middle) if fallen(middle) else (middle, far)
    return near, far
