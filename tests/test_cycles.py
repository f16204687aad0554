"""No module of the package imports itself by way of others."""

import grimp
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components


def cycles(graph: grimp.ImportGraph) -> list[set[str]]:
    """Sets of two modules or more that reach each other."""
    modules = sorted(graph.modules)
    imports = [
        (row, modules.index(other))
        for row, one in enumerate(modules)
        for other in graph.find_modules_directly_imported_by(one)
    ]
    ends = tuple(zip(*imports, strict=True))
    edges = coo_array(([1] * len(imports), ends), shape=(len(modules), len(modules)))
    count, labels = connected_components(edges, connection="strong")
    parts = [{module for module, label in zip(modules, labels, strict=True) if label == part} for part in range(count)]
    return [part for part in parts if len(part) > 1]


def test_no_module_imports_itself_by_way_of_others() -> None:
    """A type alone may be imported both ways: nothing runs then."""
    graph = grimp.build_graph("shipid", cache_dir=None, exclude_type_checking_imports=True)
    assert cycles(graph) == []


def test_no_two_modules_name_each_other() -> None:
    """Not even for a type: a file can be understood without those that use it."""
    graph = grimp.build_graph("shipid", cache_dir=None)
    imports = {(one, other) for one in graph.modules for other in graph.find_modules_directly_imported_by(one)}
    assert [pair for pair in sorted(imports) if pair[::-1] in imports] == []


def test_a_planted_circle_is_seen() -> None:
    graph = grimp.build_graph("shipid", cache_dir=None)
    graph.add_import(importer="shipid.units", imported="shipid.predictor")
    graph.add_import(importer="shipid.predictor", imported="shipid.units")
    assert any({"shipid.units", "shipid.predictor"} <= circle for circle in cycles(graph))
