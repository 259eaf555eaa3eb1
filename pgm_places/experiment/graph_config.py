"""A graph of one's own as a configuration describes it: its files, and what their columns mean."""

from dataclasses import dataclass

from pgm_places.errors import ConfigError
from pgm_places.options import check_options


@dataclass(frozen=True, kw_only=True)
class GraphConfig:
    """A graph with the true labels of its nodes, for ``nodes = "graph"``.

    Parameters
    ----------
    file : str, optional
        A GraphML file, whose attributes of nodes and of edges are the columns of two tables.
    nodes, edges : str, optional
        The two tables instead, CSV or Parquet: a row per node, and a row per edge. Without edges
        each node is by itself.
    node : str
        The column that names the nodes.
    ends : (str, str)
        The columns that name the two nodes of an edge.
    label : str
        The column of true labels; it is empty where they are not known.
    classes : mapping, optional
        From the texts of that column to label names; what it leaves out has no label.
    known : str, optional
        The column of labels that methods are told and therefore not asked for: evidence.
    features : list of str, optional
        The node features; by default all columns of numbers that have no other meaning.
    edge_features : list of str, optional
        The same for edges.
    probabilities : list of str, optional
        For each label, in their order, the column of its probability by a classifier of one's own,
        which takes the place of the configuration's.
    positions : (str, str), optional
        The columns of x and y: for pictures, and to hold out nodes that lie together.
    """

    file: str | None = None
    nodes: str | None = None
    edges: str | None = None
    node: str = "node"
    ends: tuple[str, str] = ("source", "target")
    label: str = "label"
    classes: dict[str, str] | None = None
    known: str | None = None
    features: tuple[str, ...] | None = None
    edge_features: tuple[str, ...] | None = None
    probabilities: tuple[str, ...] | None = None
    positions: tuple[str, str] | None = None

    def __post_init__(self) -> None:
        check_options(self)
        if (self.file is None) == (self.nodes is None):
            raise ConfigError("give either file (GraphML) or nodes (a table)")
        if self.file is not None and self.edges is not None:
            raise ConfigError("edges is a table beside nodes; a GraphML file has its own edges")

    @property
    def other_columns(self) -> tuple[str, ...]:
        """The columns of nodes that are no features."""
        named = [self.node, self.label, *(self.probabilities or ()), *(self.positions or ())]
        return (*named, self.known) if self.known is not None else tuple(named)
