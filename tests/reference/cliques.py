"""What a set of nodes that want one label earns, written out from the definition."""

from collections.abc import Sequence


def set_score(
    nodes: Sequence[int], labels: Sequence[int], rewards: Sequence[float], dissent: float
) -> float:
    """``max(0, max_k rewards[k] (n - d_k / dissent))`` with d_k nodes of another label than k."""
    best = 0.0
    for k, reward in enumerate(rewards):
        differing = sum(labels[node] != k for node in nodes)
        best = max(best, reward * (len(nodes) - differing / dissent))
    return best
