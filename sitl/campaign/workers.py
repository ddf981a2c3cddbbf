"""Who drives the runs of a campaign: processes of this machine, or those of a cluster.

Nouns: worker.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path

from companion.mapping.map_files import MapError
from companion.mission.mission import MissionError
from sitl.campaign.campaign_file import CampaignError, CampaignTable
from sitl.campaign.drive_run import drive
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.run_store import digest_of

Done = Iterator[tuple[RunSpec, RunResult]]
RETRIES = 5
"""So often a run is driven again whose worker has gone."""


def driven_here(specs: Sequence[RunSpec], folder: Path, jobs: int) -> Done:
    """Each run with its result, as they are done. Raises CampaignError if joblib is needed and not installed."""
    if jobs == 1:
        return ((spec, drive(spec, folder)) for spec in specs)
    try:
        from joblib import Parallel, delayed
    except ImportError as error:
        raise CampaignError(
            f"--jobs {jobs}: joblib is not installed; install rover-companion[experiments], or leave the option out"
        ) from error
    done: Done = Parallel(n_jobs=jobs, return_as="generator_unordered")(delayed(_pair)(spec, folder) for spec in specs)
    return done


def driven_on(specs: Sequence[RunSpec], campaign: CampaignTable, folder: Path, address: str) -> Done:
    """The same by the workers of a dask scheduler. Each needs this version of the code, and the campaign's folder.

    A run whose worker has gone is driven by another one. Raises CampaignError when there is no scheduler, and when a
    worker has other code or other files.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise CampaignError(
            f"--cluster {address}: dask is not installed; install rover-companion[cluster], or leave the option out"
        ) from error
    try:
        client = Client(address, timeout="5s")
    except (OSError, ValueError) as error:
        raise CampaignError(f"--cluster {address}: nobody answers there; start one: dask scheduler") from error
    drives = partial(_checked, campaign=campaign, folder=folder, digest=digest_of(campaign, folder))
    with client:
        futures = client.map(drives, specs, retries=RETRIES, pure=False, batch_size=50)
        for future in as_completed(futures):
            yield future.result()
            future.release()


def _pair(spec: RunSpec, folder: Path) -> tuple[RunSpec, RunResult]:
    return spec, drive(spec, folder)


def _checked(spec: RunSpec, campaign: CampaignTable, folder: Path, digest: str) -> tuple[RunSpec, RunResult]:
    """A worker's. Raises CampaignError where its code or files are not those of the campaign."""
    try:
        own = digest_of(campaign, folder)
    except (OSError, MissionError, MapError) as error:
        raise CampaignError(f"a worker cannot read the campaign's files: {error}") from error
    if own != digest:
        raise CampaignError(f"a worker has other code, or other files in {folder}; install the same version there")
    return _pair(spec, folder)
