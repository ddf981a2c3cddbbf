"""What holds for every test."""

from __future__ import annotations

import os
from collections.abc import Iterator

import pytest
from hypothesis import HealthCheck, settings
from hypothesis.database import DirectoryBasedExampleDatabase

from companion.cli import kernel_cache
from tests.support.quick import examples

kernel_cache.use_cache(os.environ)  # before a test imports numba

# The same examples every time, on however busy a machine. ``make fuzz`` draws new ones, and tries finds again.
settings.register_profile(
    "fixed",
    max_examples=examples(100),
    derandomize=True,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow],
)
settings.register_profile(
    "search",
    parent=settings.get_profile("fixed"),
    derandomize=False,
    database=DirectoryBasedExampleDatabase("out/fuzz/examples"),
    print_blob=True,
)
settings.load_profile(os.environ.get("HYPOTHESIS_PROFILE", "fixed"))


@pytest.fixture(scope="session", autouse=True)
def own_place_for_states(tmp_path_factory: pytest.TempPathFactory) -> Iterator[None]:
    """Runs without a state directory do not use that of the user, nor that of another worker."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("XDG_STATE_HOME", str(tmp_path_factory.mktemp("states")))
        yield


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Two workers begin with the tests that wait for real time, while the others keep the processors busy.

    With ``--dist worksteal`` each worker begins with an equal share of the list, in its order.
    """
    workers = getattr(config, "workerinput", {}).get("workercount", 1)
    slow = [item for item in items if item.get_closest_marker("slow")]
    others = [item for item in items if not item.get_closest_marker("slow")]
    waiting, share = min(2, workers), len(items) / workers
    ordered: list[pytest.Item] = []
    for worker in range(workers):
        first = slow[worker::waiting] if worker < waiting else []
        more = round((worker + 1) * share) - len(ordered) - len(first)
        ordered += first + others[:more]
        others = others[more:]
    items[:] = ordered + others
