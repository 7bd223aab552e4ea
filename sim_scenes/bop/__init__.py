"""BOP datasets in the scenewise layout, written and read.

    ROOT/camera.json, dataset_info.md
    ROOT/models/obj_000001.ply, models_info.json
    ROOT/SPLIT/000000/rgb/000000.png, depth/000000.png
                      mask/000000_000000.png, mask_visib/000000_000000.png
                      scene_camera.json, scene_gt.json, scene_gt_info.json, scene_source.json

Translations and models are in millimetres, depth images in `depth_scale` millimetres, as BOP has
it. What is written also holds these extra keys, so that reading gives back the same bits; foreign
data does without them.

- `scene_camera`: `world_from_camera` (16 numbers, row-major, metres), `joint_positions_rad`
- `scene_gt`: `world_from_object` (likewise), `instance_id`
- `models_info`: `name`, `category`
- `scene_source.json`: the scene's name, spec, seed and redraws
"""

from __future__ import annotations

from sim_scenes.bop.reader import BopDataset, open_bop, read_bop
from sim_scenes.bop.writer import write_bop

__all__ = ["BopDataset", "open_bop", "read_bop", "write_bop"]
