"""Collections of problem files that others publish: what is added, what is refused, and what is said of it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench

from cpbench import storage
from cpbench.bench.planning.places import located
from cpbench.errors import CpbenchError, UnknownName
from cpbench.generators.collection import address_text
from cpbench.storage.collections import added, manifests
from cpbench.storage.collections.manifests import ListedFile, Manifest

SUITED = {
    "diphasic": "diphasic-Ma.txt",
    "hock-schittkowski": "hs071.gms",
    "maros-meszaros": "HS118.mat",
    "maros-meszaros-sif": "HS118.SIF",
    "mpc-qpbenchmark": "LIPMWALK0.npz",
    "mpeclib": "frictionalblock_1.gms",
    "siconos-numerics": "fc3d_global/CubeH8.hdf5",
}
"""Collections of which the folder of real files has what is listed, and a problem of each."""


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the three files of `known`, as they lie in their repository; sets are added below tmp_path."""
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    folder = tmp_path / "clone"
    (folder / "test" / "sub").mkdir(parents=True)
    np.savetxt(folder / "test" / "Ma.txt", [[2.0, 1.0], [1.0, 2.0]])
    np.savetxt(folder / "test" / "qa.txt", [-5.0, -6.0])
    (folder / "test" / "sub" / "readme.md").write_text("of the set\n")
    return folder


def known(folder: Path, **changed: object) -> Manifest:
    """A manifest of the files of `source` with their hashes; two of them have other names in the set."""
    names = {"lcp-Ma.txt": "Ma.txt", "lcp-qa.txt": "qa.txt", "sub/readme.md": "sub/readme.md"}
    files = {}
    for name, origin in names.items():
        data = (folder / "test" / origin).read_bytes()
        files[name] = ListedFile(len(data), hashlib.sha256(data).hexdigest(), origin)
    facts = {"title": "two unknowns", "formulation": "lcp", "reader": "text-lcp", "source": "https://example.org/set"}
    rest = {
        "licence": "MIT",
        "citation": "Cottle, Pang and Stone 1992",
        "commit": "abc",
        "folder": "test",
        "count": 3,
        "files": files,
    }
    return Manifest(**{"name": "diphasic", **facts, **rest, **changed})  # pyright: ignore[reportArgumentType]


def test_a_folder_of_the_user_is_an_address(source: Path) -> None:
    """A link to the folder of the source will do, and files may have their names in the source."""
    listed = known(source)
    added.home().mkdir(parents=True)
    (added.home() / "diphasic").symlink_to(source / "test")
    found = added.check(listed)
    assert found is not None
    assert found.files == ("lcp-Ma.txt", "lcp-qa.txt", "sub/readme.md")
    assert (found.missing, found.changed) == ((), ())
    assert found.size == sum(path.stat().st_size for path in (source / "test").rglob("*") if path.is_file())
    place = located("collection/diphasic", Path)
    (source / "test" / "Ma.txt").rename(source / "test" / "lcp-Ma.txt")
    (source / "test" / "qa.txt").rename(source / "test" / "lcp-qa.txt")
    np.testing.assert_array_equal(storage.load(f"{place}/lcp-Ma.txt").q, [-5.0, -6.0])
    assert address_text(f"{place}/lcp-Ma.txt") == "collection/diphasic/lcp-Ma.txt"
    (source / "test" / "lcp-Ma.txt").write_text("1 2\n")
    (source / "test" / "sub" / "readme.md").unlink()
    found = added.check(listed)
    assert found is not None
    assert (found.missing, found.changed) == (("sub/readme.md",), ("lcp-Ma.txt",))


def test_files_of_the_user_have_no_hashes(source: Path) -> None:
    added.home().mkdir(parents=True)
    (added.home() / "macmpec").symlink_to(source)
    found = added.check(known(source, name="macmpec", files={}, names=("*.txt",)))
    assert found is not None
    assert found.files == ("test/Ma.txt", "test/qa.txt")


def test_an_absent_collection_ends_with_where_its_files_go(source: Path, tmp_path: Path) -> None:
    (tmp_path / "night.toml").write_text('problems = ["collection/fclib"]\nsolvers = ["siconos-lcp-lemke"]\n')
    for arguments in (
        ("run", "collection/fclib/Cubes_H8"),
        ("run", "--plan", "night.toml"),
        ("info", "collection/fclib"),
        ("collection", "verify", "fclib"),
    ):
        done = cpbench(tmp_path, *arguments)
        told = done.stdout + done.stderr
        assert "not there" in told
        assert "put the files of https://github.com/" in told
        lines = [line for line in told.splitlines() if not line.startswith(("plan: ", " "))]  # but progress, when slow
        assert lines == [told.splitlines()[-1]]
        assert done.returncode == (1 if "verify" in arguments else 2)
    assert not (tmp_path / "night.sqlite").exists()
    with pytest.raises(UnknownName, match="unknown collection 'fclob': did you mean fclib"):
        located("collection/fclob/a.hdf5", Path)
    with pytest.raises(CpbenchError, match="is not there"):
        located("collection/fclib::name", Path)


def test_every_manifest_is_complete() -> None:
    formats = {one.name for one in storage.formats}
    for one in map(manifests.manifest, manifests.names()):
        assert one.title, one.name
        assert one.citation, one.name
        assert one.source.startswith("https://"), one.name
        assert {*one.reader.split(", ")} <= formats | {""}, one.name
        assert bool(one.files) != bool(one.names), f"{one.name}: files have hashes, or the user brings them"
        assert one.count is None or len(one.files) <= one.count, one.name
        for name, listed in one.files.items():
            assert len(listed.sha256) == 64, name
            assert listed.size > 0, name
            assert ".." not in Path(name).parts, name
    assert {"fclib", "maros-meszaros", "cblib-socp", "transportation-networks", *SUITED} <= set(manifests.names())


@pytest.mark.parametrize("name", SUITED)
def test_real_files_are_verified_and_read(name: str, shared_data: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    one = manifests.manifest(name)
    by_name = {path.name: path for path in sorted(shared_data.rglob("*")) if path.is_file()}
    for file, listed in one.files.items():
        link = added.home() / name / file
        link.parent.mkdir(parents=True, exist_ok=True)
        link.symlink_to(by_name.get(Path(file).name) or by_name[Path(listed.origin).name])
    done = cpbench(tmp_path, "collection", "verify", name)
    assert (done.returncode, done.stdout.count("\n")) == (0, 1)
    assert f"{len(one.files)} as the manifest has them" in done.stdout
    chosen = storage.formats.get(one.reader.split(", ")[0])
    place = located(f"collection/{name}/{SUITED[name]}", Path)
    problem = storage.load(place)
    assert problem.fingerprint == chosen.load(Path(place), "").fingerprint
    assert problem.node in one.formulation.split(", ")
