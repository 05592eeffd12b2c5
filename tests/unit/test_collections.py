"""Collections of problem files that others publish: what is added, what is refused, and what is said of it."""

from __future__ import annotations

import hashlib
from pathlib import Path

import numpy as np
import pytest
from command_line import cpbench

from cpbench import storage
from cpbench.bench.planning.places import located
from cpbench.errors import CpbenchError, FormatError, UnknownName
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


def test_files_are_copied_under_their_names_in_the_set(source: Path) -> None:
    found = added.add(known(source), source)
    assert found.files == ("lcp-Ma.txt", "lcp-qa.txt", "sub/readme.md")
    assert found.missing == ()
    assert found.size == sum(path.stat().st_size for path in (source / "test").rglob("*") if path.is_file())
    place = located("collection/diphasic", Path)
    assert storage.problem_files([place]) == [f"{place}/lcp-Ma.txt"]
    np.testing.assert_array_equal(storage.load(f"{place}/lcp-Ma.txt").q, [-5.0, -6.0])
    assert address_text(f"{place}/lcp-Ma.txt") == "collection/diphasic/lcp-Ma.txt"
    assert [path.name for path in added.home().iterdir()] == ["diphasic"], "nothing temporary is left"


def test_files_are_recognized_wherever_they_lie(source: Path, tmp_path: Path) -> None:
    flat = tmp_path / "flat"
    flat.mkdir()
    for name, origin in (("lcp-Ma.txt", "Ma.txt"), ("qa.txt", "qa.txt"), ("readme.md", "sub/readme.md")):
        (flat / name).write_bytes((source / "test" / origin).read_bytes())
    (source / "Ma.txt").write_text("another file with this name\n")
    assert added.add(known(source), flat).missing == ()
    assert added.add(known(source), source, force=True).missing == (), "the content decides between equal names"


def test_a_missing_file_is_named_and_the_others_are_added(source: Path) -> None:
    listed = known(source)
    (source / "test" / "qa.txt").unlink()
    assert added.add(listed, source).missing == ("lcp-qa.txt",)
    assert added.add(listed, source, force=True).files == ("lcp-Ma.txt", "sub/readme.md")


def test_a_wrong_file_stops_all(source: Path) -> None:
    listed = known(source)
    (source / "test" / "Ma.txt").write_bytes(b"1 2\n")
    said = r"1 file whose SHA-256 is not that of the manifest \(Ma\.txt\): take those of commit abc \(pointers: .*\)"
    with pytest.raises(FormatError, match=rf"clone: has {said}; nothing was added$"):
        added.add(listed, source)
    assert list(added.home().iterdir()) == []


def test_a_wrong_file_leaves_what_was_added(source: Path) -> None:
    listed = known(source)
    added.add(listed, source)
    (source / "test" / "Ma.txt").write_bytes(b"1 2\n")
    with pytest.raises(FormatError, match="there already: cpbench collection verify diphasic checks it, --force"):
        added.add(listed, source)
    with pytest.raises(FormatError, match="nothing was added"):
        added.add(listed, source, force=True)
    found = added.check(listed)
    assert found is not None
    assert (found.missing, found.changed) == ((), ())


def test_a_folder_without_the_files_is_refused(source: Path, tmp_path: Path) -> None:
    listed = known(source)
    (tmp_path / "nothing").mkdir()
    with pytest.raises(
        FormatError, match=r"has no file of the collection 'diphasic', such as lcp-Ma\.txt, lcp-qa\.txt"
    ):
        added.add(listed, tmp_path / "nothing")
    with pytest.raises(FormatError, match=r"is no folder: --from takes the one with the files of https://example\.org"):
        added.add(listed, tmp_path / "absent")


def test_a_copy_that_changed_is_seen(source: Path) -> None:
    listed = known(source)
    folder = added.add(listed, source).folder
    (folder / "lcp-Ma.txt").write_text("1 2\n")
    (folder / "sub" / "readme.md").unlink()
    found = added.check(listed)
    assert found is not None
    assert (found.missing, found.changed) == (("sub/readme.md",), ("lcp-Ma.txt",))


def test_files_of_the_user_are_kept_as_they_were_added(source: Path) -> None:
    free = known(source, name="macmpec", files={}, names=("*.txt",))
    found = added.add(free, source)
    assert found.files == ("test/Ma.txt", "test/qa.txt")
    (found.folder / "test" / "Ma.txt").write_text("1 2\n")
    again = added.check(free)
    assert again is not None
    assert again.changed == ("test/Ma.txt",)


def test_an_absent_collection_ends_with_the_command_that_adds_it(source: Path, tmp_path: Path) -> None:
    (tmp_path / "night.toml").write_text('problems = ["collection/fclib"]\nsolvers = ["siconos-lcp-lemke"]\n')
    for arguments in (
        ("run", "collection/fclib/Cubes_H8"),
        ("run", "--plan", "night.toml"),
        ("info", "collection/fclib"),
        ("collection", "verify", "fclib"),
    ):
        done = cpbench(tmp_path, *arguments)
        told = done.stdout + done.stderr
        assert "cpbench collection add fclib --from DIR, where DIR has the files of https://github.com/" in told
        lines = [line for line in told.splitlines() if not line.startswith(("plan: ", " "))]  # but progress, when slow
        assert lines == [told.splitlines()[-1]]
        assert done.returncode == (1 if "verify" in arguments else 2)
    assert not (tmp_path / "night.sqlite").exists()
    with pytest.raises(UnknownName, match="unknown collection 'fclob': did you mean fclib"):
        located("collection/fclob/a.hdf5", Path)
    with pytest.raises(CpbenchError, match="has not been added"):
        located("collection/fclib::name", Path)


def test_a_folder_that_is_called_collection_is_itself(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "collection" / "mine").mkdir(parents=True)
    assert located("collection/mine", Path) == "collection/mine"


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
def test_real_files_are_added_verified_and_read(name: str, shared_data: Path, tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setenv("XDG_DATA_HOME", str(tmp_path / "data"))
    one = manifests.manifest(name)
    done = cpbench(tmp_path, "collection", "add", name, "--from", str(shared_data))
    assert f"{len(one.files)} of them checked" in done.stdout
    done = cpbench(tmp_path, "collection", "verify", name)
    assert (done.returncode, done.stdout.count("\n")) == (0, 1)
    assert f"{len(one.files)} as the manifest has them" in done.stdout
    chosen = storage.formats.get(one.reader.split(", ")[0])
    place = located(f"collection/{name}/{SUITED[name]}", Path)
    problem = storage.load(place)
    assert problem.fingerprint == chosen.load(Path(place), "").fingerprint
    assert problem.node in one.formulation.split(", ")


def test_what_is_listed_and_what_is_there(source: Path, tmp_path: Path) -> None:
    done = cpbench(tmp_path, "collection", "list")
    assert done.returncode == 0
    assert "partial: 97 of 138 files listed" in done.stdout
    done = cpbench(tmp_path, "collection", "verify")
    assert done.stdout.count("not added; cpbench collection add") == len(manifests.names())
