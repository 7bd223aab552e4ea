from __future__ import annotations

import hashlib
import json
from typing import TYPE_CHECKING, Any

import numpy as np
import pybullet_data
import pytest
import trimesh

from sim_scenes.geometry import rigid, rotation_from_quaternion
from sim_scenes.objects import CATEGORIES, ObjectError, load_object_set, object_set
from sim_scenes.objects.draws import Split
from sim_scenes.objects.generate import encode_object
from sim_scenes.solid import solid_from_model

if TYPE_CHECKING:
    from pathlib import Path

BOX = trimesh.creation.box((0.1, 0.08, 0.06))


def write(folder: Path, *entries: dict[str, Any], name: str = "manifest.json") -> None:
    (folder / name).write_text(json.dumps(list(entries)), encoding="utf-8")


def mug(path: str = "a.obj", **fields: Any) -> dict[str, Any]:
    return {"path": path, "category": "mug", **fields}


def put(folder: Path, mesh: trimesh.Trimesh = BOX, path: str = "a.obj") -> Path:
    target = folder / path
    target.parent.mkdir(parents=True, exist_ok=True)
    mesh.export(target)
    return target


def indexed(vertex: int) -> bytes:
    """A tetrahedron of 10 cm, two of its faces, the second of which ends in a given vertex."""
    header = (
        "ply\nformat ascii 1.0\nelement vertex 4\n"
        "property float x\nproperty float y\nproperty float z\n"
        "element face 2\nproperty list uchar int vertex_indices\nend_header\n"
    )
    return f"{header}0 0 0\n.1 0 0\n0 .1 0\n0 0 .1\n3 0 1 2\n3 0 1 {vertex}\n".encode()


@pytest.mark.parametrize("name", ["manifest.json", "MANIFEST.json"])
def test_reads_a_folder(tmp_path: Path, name: str) -> None:
    put(tmp_path, path="mug/blue/model.obj")
    put(tmp_path, path="bowl/b.ply")
    write(
        tmp_path,
        {"path": "mug/blue/model.obj", "category": "mug", "license": "MIT", "kind": "scan"},
        {"path": "bowl/b.ply", "category": "bowl", "name": "deep"},
        name=name,
    )
    found = load_object_set(tmp_path)
    assert [(m.name, m.category, m.license, m.texture_path) for m in found.models] == [
        ("blue", "mug", "MIT", None),
        ("deep", "bowl", None, None),
    ]
    assert found.of("bowl") == found.models[1:]
    found.check_meshes()


def test_geometry_is_only_rounded_to_float32(tmp_path: Path) -> None:
    shape = trimesh.creation.icosphere(subdivisions=1, radius=0.0411111111)
    shape.apply_translation([0.3, 0.2, 0.1])
    put(tmp_path, shape)
    write(tmp_path, mug())
    mesh = load_object_set(tmp_path).models[0].load_mesh()
    assert np.array_equal(mesh.vertices, mesh.vertices.astype(np.float32))
    # OBJ text holds eight decimals.
    assert np.allclose(mesh.vertices, shape.vertices, atol=2e-8)
    assert np.array_equal(mesh.faces, shape.faces)


def test_finds_the_picture_of_an_obj(tmp_path: Path) -> None:
    target = put(tmp_path)
    target.write_text("mtllib a.mtl\n" + target.read_text(encoding="utf-8"), encoding="utf-8")
    (tmp_path / "a.mtl").write_text("newmtl m\nmap_Kd skin.png\n", encoding="utf-8")
    write(tmp_path, mug())
    assert load_object_set(tmp_path).models[0].texture_path is None
    (tmp_path / "skin.png").write_bytes(b"picture")
    assert load_object_set(tmp_path).models[0].texture_path == tmp_path / "skin.png"


def test_texture_of_the_manifest(tmp_path: Path) -> None:
    put(tmp_path)
    write(tmp_path, mug(texture="skin.png"))
    with pytest.raises(ObjectError, match=r"skin\.png: no such texture; correct the entry of a"):
        load_object_set(tmp_path)


def test_package_mesh_is_found_in_its_package() -> None:
    found = pybullet_data.getDataPath()
    models = load_object_set().models
    mug_model = next(m for m in models if m.name == "mug_pybullet")
    assert str(mug_model.path).startswith(found)
    mesh = mug_model.load_mesh()
    assert mesh.bounds[0, 2] == 0.0
    assert mesh.extents == pytest.approx([0.082, 0.121633, 0.1], abs=1e-6)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "cannot be read as JSON"),
        ("{}", "not a list of at least one mesh"),
        ("[]", "not a list of at least one mesh"),
        ("[3]", "entry 0 is 3, not an object"),
        ('[{"category": "mug"}]', "entry 0 has no path; every mesh needs one"),
        ('[{"path": "a.obj"}]', "entry 0 has no category"),
        ('[{"path": "", "category": "mug"}]', "entry 0 has path ''; give a text"),
        ('[{"path": "a.obj", "category": "Mug"}]', r"category 'Mug'; use one of bottle, bowl"),
        ('[{"path": "a.obj", "category": "mug", "sha256": 1}]', "sha256 1; give a text"),
        ('[{"path": "a", "category": "mug", "extents_m": [1]}]', "give three numbers in metres"),
    ],
)
def test_malformed_manifests(tmp_path: Path, text: str, message: str) -> None:
    (tmp_path / "manifest.json").write_text(text, encoding="utf-8")
    with pytest.raises(ObjectError, match=message) as caught:
        load_object_set(tmp_path)
    assert str(caught.value).startswith(str(tmp_path / "manifest.json"))


def test_no_folder_and_no_manifest(tmp_path: Path) -> None:
    with pytest.raises(ObjectError, match=r"none: no such folder; pass a folder of meshes"):
        load_object_set(tmp_path / "none")
    with pytest.raises(ObjectError, match=r"no manifest\.json; write one that lists the meshes"):
        load_object_set(tmp_path)


def test_not_installed_beside_a_checkout(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(object_set, "BENCHMARK_FOLDER", tmp_path / "assets")
    with pytest.raises(ObjectError, match=r"not installed; work in a checkout.*--objects"):
        load_object_set()


@pytest.mark.parametrize("path", ["../a.obj", "/etc/hostname", "sub/../../a.obj"])
def test_paths_stay_in_the_folder(tmp_path: Path, path: str) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    put(tmp_path)
    write(folder, mug(path))
    with pytest.raises(ObjectError, match=r"leads out of .*; keep the files in the manifest's"):
        load_object_set(folder)


@pytest.mark.parametrize("field", ["path", "texture"])
@pytest.mark.parametrize(
    ("name", "reason"),
    [
        ("a\0.obj", "embedded null byte"),
        ("a" * 300, "File name too long"),
        ("round", "links in a circle"),
    ],
)
def test_texts_that_are_no_paths(tmp_path: Path, field: str, name: str, reason: str) -> None:
    put(tmp_path)
    (tmp_path / "round").symlink_to("round")
    write(tmp_path, mug(**{field: name}))
    with pytest.raises(ObjectError, match=rf"is no file's path \({reason}\); correct the") as it:
        load_object_set(tmp_path)
    assert str(it.value).startswith(f"{tmp_path}: {name!r:.80} is")


def test_links_do_not_lead_out(tmp_path: Path) -> None:
    folder = tmp_path / "set"
    folder.mkdir()
    (folder / "a.obj").symlink_to(put(tmp_path))
    write(folder, mug())
    with pytest.raises(ObjectError, match="leads out of"):
        load_object_set(folder)


def test_missing_file_and_unknown_package(tmp_path: Path) -> None:
    write(tmp_path, mug("gone.obj"))
    with pytest.raises(ObjectError, match=r"gone\.obj: no such file; correct its path"):
        load_object_set(tmp_path)
    write(tmp_path, mug(package="os"))
    with pytest.raises(ObjectError, match="names package 'os'; only pybullet_data is known"):
        load_object_set(tmp_path)


def test_sha256_is_verified(tmp_path: Path) -> None:
    target = put(tmp_path)
    digest = hashlib.sha256(target.read_bytes()).hexdigest()
    write(tmp_path, mug(sha256=digest.upper()))
    assert len(load_object_set(tmp_path).models) == 1
    target.write_text(target.read_text(encoding="utf-8") + "\n", encoding="utf-8")
    with pytest.raises(ObjectError, match=f"the manifest says {digest.upper()}; restore the file"):
        load_object_set(tmp_path)


def test_names_are_unique(tmp_path: Path) -> None:
    put(tmp_path, path="x/a.obj")
    put(tmp_path, path="y/a.obj")
    write(tmp_path, mug("x/a.obj"), mug("y/a.obj"))
    with pytest.raises(ObjectError, match="both named 'a'; give each entry a 'name' of its own"):
        load_object_set(tmp_path)


@pytest.mark.parametrize(
    ("name", "data", "message"),
    [
        ("a.obj", b"", "has no faces; export it again"),
        ("a.obj", b"v 0 0 0\nv .1 0 0\n", "has no faces; export it again"),
        ("a.obj", b"v nan 0 0\nv .1 0 0\nv 0 .1 0\nf 1 2 3\n", "vertex 0 is not finite"),
        ("a.obj", b"v 0 0 0\nv 1e50 0 0\nv 0 .1 0\nf 1 2 3\n", "vertex 1 is not finite"),
        ("a.obj", b"v 0 0 0\nv .1 0 0\nv 0 .1 0\nf 1 2 9\n", "cannot be read as a mesh"),
        ("a.obj", b"v 0 0 0\nv 80 0 0\nv 0 90 0\nf 1 2 3\n", "90 m large, over 1 m; scale it"),
        ("a.obj", b"v 0 0 0\nv .004 0 0\nv 0 .004 0\nf 1 2 3\n", "4 mm large, under 5 mm"),
        (
            "a.obj",
            b"v 0 0 0\nv .1 0 0\nv 0 .1 .1\nf 1 2 3\n",
            "mm thick, under 0.5 mm: too flat to",
        ),
        ("a.ply", indexed(-1), "face 1 names vertex -1 of 4; export it again"),
        ("a.ply", indexed(4), "face 1 names vertex 4 of 4; export it again"),
        ("a.xyzw", b"what is this", "cannot be read as a mesh"),
    ],
)
# A coordinate beyond float32 becomes infinite: that is what the check is for.
@pytest.mark.filterwarnings("ignore:overflow encountered in cast:RuntimeWarning")
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_meshes_that_cannot_be_used(tmp_path: Path, name: str, data: bytes, message: str) -> None:
    (tmp_path / name).write_bytes(data)
    write(tmp_path, mug(name))
    model = load_object_set(tmp_path).models[0]
    with pytest.raises(ObjectError, match=message) as caught:
        model.load_mesh()
    assert str(caught.value).startswith(str(tmp_path / name))
    with pytest.raises(ObjectError, match=message):
        load_object_set(tmp_path).check_meshes()


@pytest.mark.parametrize("tilt", [0.0, 0.7])
def test_a_sheet_of_a_millimetre_is_not_flat_and_a_thinner_one_is(
    tmp_path: Path, tilt: float
) -> None:
    turn = rigid(
        rotation=rotation_from_quaternion([np.sin(tilt), 0.0, 0.0, np.cos(tilt)]),
        translation=[0, 0, 0],
    )
    for thickness_m, name in ((0.001, "card.ply"), (0.0003, "foil.ply")):
        put(tmp_path, trimesh.creation.box((0.1, 0.08, thickness_m), transform=turn), name)
    write(tmp_path, mug("card.ply"), mug("foil.ply"))
    card, foil = load_object_set(tmp_path).models
    card.load_mesh()
    assert len(solid_from_model(card).hull) == 8
    with pytest.raises(ObjectError, match=r"foil\.ply: 0\.3 mm thick, under 0\.5 mm: too flat"):
        foil.load_mesh()


@pytest.mark.parametrize("extension", ["ply", "stl", "glb"])
@pytest.mark.parametrize("share", [0.1, 0.5, 0.95])
@pytest.mark.filterwarnings("ignore::ResourceWarning")
def test_truncated_files(tmp_path: Path, extension: str, share: float) -> None:
    target = put(tmp_path, path=f"a.{extension}")
    data = target.read_bytes()
    target.write_bytes(data[: int(share * len(data))])
    write(tmp_path, mug(target.name))
    with pytest.raises(ObjectError, match=f"{target.name}: .*export it again"):
        load_object_set(tmp_path).models[0].load_mesh()


@pytest.mark.parametrize("category", CATEGORIES)
def test_committed_meshes_come_out_of_the_generator(category: str) -> None:
    model = load_object_set().of(category)[0]
    _, data = encode_object(split=Split.TEST, category=category, index=0, seed=2)
    assert data == model.path.read_bytes()
