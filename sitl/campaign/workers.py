"""Who drives the runs of a campaign: processes of this machine, or those of a cluster.

Nouns: worker.
"""

from __future__ import annotations

import logging
import os
import socket
from collections.abc import Iterator, Sequence
from pathlib import Path
from textwrap import shorten
from typing import Any

from companion.core.extras import not_installed
from sitl.campaign.campaign_file import CampaignError
from sitl.campaign.drive_run import drive
from sitl.campaign.run_spec import RunResult, RunSpec
from sitl.campaign.run_store import Digests
from sitl.campaign.worker_start import begin
from sitl.worker_end import apart

Done = Iterator[tuple[RunSpec, RunResult]]
RETRIES = 3
"""So often a run is begun again that a worker could not begin. One whose worker has gone the scheduler itself gives to
another worker."""
WORKERS_S = 60.0
"""For so long a campaign waits for the first worker of a cluster."""
MOST_WORDS = 200
"""Letters of an error that are told."""


def driven_here(specs: Sequence[RunSpec], digests: Digests, jobs: int) -> Done:
    """Each run with its result, as they are done.

    Raises CampaignError if joblib is needed and not installed, when a process was killed, and when a file of a run is
    changed meanwhile.
    """
    if jobs == 1:
        return (_checked(spec, digests.of(spec), digests.folder) for spec in specs)
    try:
        from joblib import Parallel, delayed
    except ImportError as error:
        raise CampaignError(not_installed(f"--jobs {jobs}", "experiments", "joblib")) from error
    done: Done = Parallel(n_jobs=jobs, return_as="generator_unordered")(
        delayed(apart)(os.getpid(), _checked, spec, digests.of(spec), digests.folder) for spec in specs
    )
    return _told(done, "a process of --jobs has ended (for want of memory?)")


def driven_on(specs: Sequence[RunSpec], digests: Digests, address: str) -> Done:
    """The same by the workers of a dask scheduler. Each needs this version of the code, and the campaign's folder.

    Raises CampaignError when there is no scheduler or no worker, when a worker has other code or other files, when
    workers keep dying, and when the scheduler has gone.
    """
    try:
        from distributed import Client
    except ImportError as error:
        raise CampaignError(not_installed(f"--cluster {address}", "cluster", "dask")) from error
    for name in ("distributed", "distributed.client"):  # they print tracebacks of what is told in one line
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout="5s")
    except (OSError, ValueError) as error:
        raise CampaignError(f"--cluster {address}: nobody answers there; start one: dask scheduler") from error
    except TypeError as error:  # tls:// without keys in dask's settings
        text = shorten(str(error), MOST_WORDS, placeholder=" ...")
        raise CampaignError(f"--cluster {address}: {text}; write tcp://HOST:PORT, or set dask up for it") from error
    return _told(_driven_by(client, specs, digests), f"--cluster {address}")


def _driven_by(client: Any, specs: Sequence[RunSpec], digests: Digests) -> Done:
    from distributed import as_completed

    with client:
        _begin(client)
        wanted = [digests.of(spec) for spec in specs]
        futures = client.map(
            _checked_on_a_worker, specs, wanted, folder=digests.folder, retries=RETRIES, pure=False, batch_size=50
        )
        for future in as_completed(futures):
            yield future.result()
            future.release()


def _begin(client: Any) -> None:
    """Wait for a worker, and have each begin. Raises CampaignError."""
    address = client.scheduler.address
    try:
        client.wait_for_workers(1, timeout=WORKERS_S)
    except TimeoutError as error:
        raise CampaignError(
            f"--cluster {address}: no worker has come within {WORKERS_S:g} s; "
            f"start some: dask worker {address} --nthreads 1"
        ) from error
    try:
        client.register_worker_callbacks(begin)  # also of workers that come later
    except Exception as error:  # such as one without the program: that comes as no ImportError
        text = shorten(f"{error}", MOST_WORDS, placeholder=" ...")
        raise CampaignError(
            f"--cluster {address}: a worker cannot begin: {text}; install the same version of the program there"
        ) from error


def _told(done: Done, what: str) -> Done:
    """The same; whatever ends the workers is told in one line."""
    try:
        yield from done
    except CampaignError:
        raise
    except Exception as error:
        text = shorten(f"{type(error).__name__}: {error}", MOST_WORDS, placeholder=" ...")
        raise CampaignError(f"{what}: {text}; what is done is kept, and the same command goes on") from error


def _checked(spec: RunSpec, digest: str, folder: Path) -> tuple[RunSpec, RunResult]:
    """A run, by the code and the files that the campaign began with. Raises CampaignError where they are others."""
    result = drive(spec, folder)
    if Digests(folder).of(spec) != digest:
        raise CampaignError(
            f"a file of the run was changed since the campaign began ({spec.world}, {spec.faults}, {spec.sensors}); "
            "the same command drives again what that changes"
        )
    return spec, result


def _checked_on_a_worker(spec: RunSpec, digest: str, folder: Path) -> tuple[RunSpec, RunResult]:
    """The same on a worker of a cluster, which may have other code and other files from the start."""
    from distributed import get_worker

    if Digests(folder).of(spec) != digest:
        raise CampaignError(
            f"the worker {get_worker().address} on {socket.gethostname()} has other code, other files in {folder}, "
            "or another numpy or numba; install the same version there"
        )
    return _checked(spec, digest, folder)
