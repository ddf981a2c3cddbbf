"""Who drives the runs of a campaign: processes of this machine, or those of a cluster.

Nouns: worker.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from sitl.campaign.campaign_file import CampaignError
from sitl.campaign.drive_run import drive
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.run_store import Digests

Done = Iterator[tuple[RunSpec, RunResult]]
RETRIES = 3
"""So often a run is begun again that a worker could not begin. One whose worker has gone the scheduler itself gives to
another worker."""


def driven_here(specs: Sequence[RunSpec], folder: Path, jobs: int) -> Done:
    """Each run with its result, as they are done.

    Raises CampaignError if joblib is needed and not installed, and when a process was killed.
    """
    if jobs == 1:
        return ((spec, drive(spec, folder)) for spec in specs)
    try:
        from joblib import Parallel, delayed
    except ImportError as error:
        raise CampaignError(
            f"--jobs {jobs}: joblib is not installed; install rover-companion[experiments], or leave the option out"
        ) from error
    done: Done = Parallel(n_jobs=jobs, return_as="generator_unordered")(delayed(_pair)(spec, folder) for spec in specs)
    return _told(done, "a process of --jobs has ended (for want of memory?)")


def driven_on(specs: Sequence[RunSpec], folder: Path, address: str) -> Done:
    """The same by the workers of a dask scheduler. Each needs this version of the code, and the campaign's folder.

    Raises CampaignError when there is no scheduler, when a worker has other code or other files, and when workers keep
    dying.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise CampaignError(
            f"--cluster {address}: dask is not installed; install rover-companion[cluster], or leave the option out"
        ) from error
    try:
        client = Client(address, timeout="5s")
    except (OSError, ValueError) as error:
        raise CampaignError(f"--cluster {address}: nobody answers there; start one: dask scheduler") from error
    return _told(_driven_by(client, specs, folder), f"--cluster {address}")


def _driven_by(client: Any, specs: Sequence[RunSpec], folder: Path) -> Done:
    from distributed import as_completed

    digests = Digests(folder)
    with client:
        wanted = [digests.of(spec) for spec in specs]
        futures = client.map(_checked, specs, wanted, folder=folder, retries=RETRIES, pure=False, batch_size=50)
        for future in as_completed(futures):
            yield future.result()
            future.release()


def _told(done: Done, what: str) -> Done:
    """The same; whatever ends the workers is told in one line."""
    try:
        yield from done
    except CampaignError:
        raise
    except Exception as error:
        text = " ".join(f"{type(error).__name__}: {error}".split())
        raise CampaignError(f"{what}: {text:.200}; what is done is kept, and the same command goes on") from error


def _pair(spec: RunSpec, folder: Path) -> tuple[RunSpec, RunResult]:
    return spec, drive(spec, folder)


def _checked(spec: RunSpec, digest: str, folder: Path) -> tuple[RunSpec, RunResult]:
    """A worker's. Raises CampaignError where its code or files are not those of the campaign."""
    if Digests(folder).of(spec) != digest:
        raise CampaignError(f"a worker has other code, or other files in {folder}; install the same version there")
    return _pair(spec, folder)
