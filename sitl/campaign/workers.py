"""Who drives the runs of a campaign: processes of this machine, or those of a cluster.

Nouns: worker.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from pathlib import Path

from sitl.campaign.campaign_file import CampaignError
from sitl.campaign.drive_run import drive
from sitl.campaign.run_spec import RunResult, RunSpec

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


def driven_on(specs: Sequence[RunSpec], folder: Path, address: str) -> Done:
    """The same by the workers of a dask scheduler; each must have this version installed, and the campaign's folder.

    A run whose worker has gone is driven by another one. Raises CampaignError when there is no scheduler.
    """
    try:
        from distributed import Client, as_completed
    except ImportError as error:
        raise CampaignError(
            f"--cluster {address}: dask is not installed; install rover-companion[cluster], or leave the option out"
        ) from error
    try:
        client = Client(address, timeout="10s")
    except (OSError, ValueError) as error:
        raise CampaignError(
            f"--cluster {address}: no scheduler answers there; start one with dask scheduler"
        ) from error
    with client:
        futures = client.map(_pair, specs, [folder] * len(specs), retries=RETRIES, pure=False, batch_size=50)
        for future in as_completed(futures):
            yield future.result()
            future.release()


def _pair(spec: RunSpec, folder: Path) -> tuple[RunSpec, RunResult]:
    return spec, drive(spec, folder)
