"""Copies the JavaScript libraries of the viewer's page from npm: ``.venv/bin/python docs/vendor_page.py``.

The copies are in the repository; nobody needs this to use the viewer. The lock file beside them names each library's
version and the sha512 of its package, and of each file that is copied, so that a test can compare without a network. A
package with another sum is refused. ``--update uplot=1.6.32`` writes the lock anew, for a version or, without one, for
the newest.
"""

from __future__ import annotations

import argparse
import base64
import hashlib
import json
import subprocess
import tarfile
import tempfile
from pathlib import Path
from typing import Any

VENDOR = Path(__file__).parents[1] / "companion" / "viewer" / "page" / "vendor"
LOCK = VENDOR / "vendor.lock.json"


def main() -> None:
    """Copies what the lock file names; with ``--update`` writes the lock file first."""
    parser = argparse.ArgumentParser(description="Copies the libraries of the viewer's page from npm.")
    parser.add_argument("--update", nargs="?", const="", metavar="NAME=VERSION", help="write the lock file anew")
    wanted = parser.parse_args().update
    lock = json.loads(LOCK.read_text(encoding="utf-8"))
    name, _, version = (wanted or "").partition("=")
    if name and name not in {package["name"] for package in lock["packages"]}:
        raise SystemExit(f"{LOCK.name}: there is no package {name}")
    for package in lock["packages"]:
        with tempfile.TemporaryDirectory() as folder:
            update = wanted is not None and name in ("", package["name"])
            tarball = _packed(package["name"], version or ("latest" if update else package["version"]), Path(folder))
            if update:
                _describe(package, tarball)
            _check(package, tarball)
            _copy(package, tarball)
    if wanted is not None:
        LOCK.write_text(json.dumps(lock, indent=2) + "\n", encoding="utf-8")


def _packed(name: str, version: str, folder: Path) -> Path:
    """The package as npm delivers it."""
    subprocess.run(["npm", "pack", "--silent", f"{name}@{version}"], cwd=folder, check=True, stdout=subprocess.DEVNULL)
    return next(folder.glob("*.tgz"))


def integrity(data: bytes) -> str:
    """The sum of a package or a file, as npm writes it."""
    return "sha512-" + base64.b64encode(hashlib.sha512(data).digest()).decode("ascii")


def _describe(package: dict[str, Any], tarball: Path) -> None:
    """Writes version, licence and sum of what came into the entry of the lock."""
    described = json.loads(_member(tarball, "package.json"))
    package["version"] = described["version"]
    package["licence"] = described["license"]
    package["integrity"] = integrity(tarball.read_bytes())
    for file in package["files"].values():
        file["integrity"] = integrity(_member(tarball, file["of"]))


def _check(package: dict[str, Any], tarball: Path) -> None:
    found = integrity(tarball.read_bytes())
    if found != package["integrity"]:
        raise SystemExit(
            f"{package['name']} {package['version']}: {found} is not {package['integrity']} of {LOCK.name}"
        )


def _copy(package: dict[str, Any], tarball: Path) -> None:
    """Copies the files that the lock names: ``{file here: {"of": file in the package, "integrity": its sum}}``."""
    for here, file in package["files"].items():
        (VENDOR / here).write_bytes(_member(tarball, file["of"]))
        print(f"{here}: {package['name']} {package['version']}")


def _member(tarball: Path, name: str) -> bytes:
    with tarfile.open(tarball) as archive:
        member = archive.extractfile(f"package/{name}")
        if member is None:
            raise SystemExit(f"{tarball.name} holds no {name}")
        return member.read()


if __name__ == "__main__":
    main()
