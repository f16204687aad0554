"""No module of the package imports itself by way of others."""

import grimp


def cycles(graph: grimp.ImportGraph) -> list[set[str]]:
    """Sets of two modules or more that reach each other (Tarjan's strongly connected components)."""
    index: dict[str, int] = {}
    low: dict[str, int] = {}
    stack: list[str] = []
    result: list[set[str]] = []

    def visit(module: str) -> None:
        index[module] = low[module] = len(index)
        stack.append(module)
        for other in graph.find_modules_directly_imported_by(module):
            if other not in index:
                visit(other)
                low[module] = min(low[module], low[other])
            elif other in stack:
                low[module] = min(low[module], index[other])
        if low[module] == index[module]:
            place = stack.index(module)
            component, stack[place:] = set(stack[place:]), []
            if len(component) > 1:
                result.append(component)

    for module in sorted(graph.modules):
        if module not in index:
            visit(module)
    return result


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
