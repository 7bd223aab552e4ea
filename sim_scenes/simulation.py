"""A scene from a spec and a seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

from sim_scenes.arm import Arm
from sim_scenes.camera import Intrinsics, d435_intrinsics
from sim_scenes.errors import SceneError, SpecError
from sim_scenes.look import Look, draw_look
from sim_scenes.placement import drop
from sim_scenes.rejected import Rejected
from sim_scenes.scene import Frame, Scene, SceneObject
from sim_scenes.solid import Solid, solid_from_model
from sim_scenes.streams import stream
from sim_scenes.views import View, Viewer
from sim_scenes.world import World

if TYPE_CHECKING:
    from collections.abc import Sequence

    from sim_scenes.geometry import Floats
    from sim_scenes.objects import ObjectModel, ObjectSet
    from sim_scenes.spec import SceneSpec


def simulate(spec: SceneSpec, seed: int, objects: ObjectSet) -> Scene:
    """Simulate a scene: a pure function of its arguments.

    The models and the look are the seed's for good; where the objects stand and where the camera
    goes is drawn again when a draw does not serve, and counted.

    Parameters
    ----------
    spec
        The family of scenes.
    seed
        Which of the family.
    objects
        The models to draw from.

    Raises
    ------
    SpecError
        If the set has no model that the spec asks for.
    SceneError
        If no draw serves within the spec's redraws; names the spec and the reasons.
    SimulatorMissing
        If PyBullet is not installed.
    """
    solids = [solid_from_model(model) for model in choose_models(spec, seed, objects)]
    look = draw_look(spec.appearance, seed, solids)
    width, height = spec.image_size
    intrinsics = d435_intrinsics(width=width, height=height)
    redraws: list[str] = []
    for attempt in range(spec.max_redraws + 1):
        try:
            placed, views = _draw(spec, seed, attempt, solids=solids, look=look, camera=intrinsics)
        except Rejected as rejected:
            redraws.append(str(rejected))
            continue
        frames = tuple(
            _frame(spec, seed, number, view=view, intrinsics=intrinsics)
            for number, view in enumerate(views)
        )
        name = f"{spec.category or spec.models[0]}-{seed}"
        return Scene(frames, placed, name, redraws=tuple(redraws), spec=spec, seed=seed)
    raise SceneError(
        f"no scene of '{spec.title}' from seed {seed} ({', '.join(s.name for s in solids)}) within "
        f"{spec.max_redraws} redraws; the last draw: {redraws[-1]}. "
        "Ask for fewer views, a larger width and height or another seed, or take the model out of "
        "the folder of objects"
    )


def choose_models(spec: SceneSpec, seed: int, objects: ObjectSet) -> list[ObjectModel]:
    """Models of a scene, the target first; no model twice."""
    models = sorted(objects.models, key=lambda model: model.name)
    random = stream(seed, "models")
    if spec.models:
        by_name = {model.name: model for model in models}
        missing = [name for name in spec.models if name not in by_name]
        if missing:
            raise SpecError(f"no model is named '{missing[0]}'; the set has {', '.join(by_name)}")
        chosen = [by_name[name] for name in spec.models]
    else:
        targets = [model for model in models if model.category == spec.category]
        if not targets:
            raise SpecError(
                f"no model is a {spec.category}; the set has "
                f"{', '.join(sorted({model.category for model in models})) or 'none at all'}"
            )
        chosen = [targets[int(random.integers(len(targets)))]]
    others = [model for model in models if model not in chosen]
    low, high = spec.objects
    missing_count = int(random.integers(low, high + 1)) - len(chosen)
    if missing_count > len(others):
        raise SpecError(
            f"objects is {spec.objects} but the set has {len(models)} models; add models"
        )
    order = random.permutation(len(others))[: max(0, missing_count)]
    return [*chosen, *(others[int(i)] for i in order)]


def _draw(
    spec: SceneSpec,
    seed: int,
    attempt: int,
    *,
    solids: Sequence[Solid],
    look: Look,
    camera: Intrinsics,
) -> tuple[tuple[SceneObject, ...], list[View]]:
    """One attempt at a scene."""
    world = World()
    bodies, poses = drop(world, solids, stream(seed, f"placement/{attempt}"))
    look.dress(world, bodies)
    viewer = Viewer(world, Arm(world), bodies, poses, camera, look.light)
    views = viewer.find(spec.arc, count=spec.views, random=stream(seed, f"views/{attempt}"))
    objects = tuple(
        _scene_object(number, solid, pose)
        for number, (solid, pose) in enumerate(zip(solids, poses, strict=True), start=1)
    )
    return objects, views


def _scene_object(number: int, solid: Solid, pose: Floats) -> SceneObject:
    return SceneObject(
        instance_id=number,
        name=solid.name,
        category=solid.category,
        vertices=solid.vertices,
        faces=solid.faces,
        world_from_object=pose,
    )


def _frame(spec: SceneSpec, seed: int, number: int, *, view: View, intrinsics: Intrinsics) -> Frame:
    """Pass a view through the depth sensor."""
    return Frame(
        rgb=view.picture.rgb,
        depth_m=spec.depth_noise.apply(
            view.picture.depth_m,
            intrinsics=intrinsics,
            random=stream(seed, f"depth noise/{number}"),
        ),
        instance_ids=view.picture.instance_ids,
        intrinsics=intrinsics,
        world_from_camera=view.world_from_camera,
        joint_positions_rad=view.joint_positions_rad,
    )
