"""Which settings each stage depends on."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from harness.protocol import COMPLETED
from harness.stages.memo import stage_key

if TYPE_CHECKING:
    from harness.config import Config
    from harness.runs.job import SceneJob

EMBEDDING_MODELS = {"metric", "metric_literal", "network"}
"""Models that the ``[pipeline.metric]`` table speaks to."""


@dataclass(frozen=True)
class StageKeys:
    """Keys of a scene's stages under a configuration.

    Parameters
    ----------
    config
        The configuration.
    job
        Which scene.
    """

    config: Config
    job: SceneJob

    @property
    def scene(self) -> str:
        """Frames and truth."""
        job = self.job
        asked = [job.object_name, job.category, job.seed, job.cluttered]
        return stage_key("render", settings=[self.config.scenes.model_dump(mode="json"), asked])

    @property
    def meshes(self) -> str:
        """The true meshes, ready to be measured against."""
        return stage_key("meshes", self.scene)

    @property
    def detections(self) -> str:
        """What the segmenter finds in the frames."""
        return stage_key(
            "segment", self.scene, settings=self._pipeline("segmenter", "segmentation")
        )

    @property
    def map(self) -> str:
        """The map of frames and detections."""
        watched = self.config.run.record
        return stage_key("map", self.detections, settings=[self._pipeline("map"), watched])

    @property
    def completed(self) -> str:
        """The map with completed shapes."""
        if self.config.pipeline["completer"] == "none":
            return self.map
        asked = self._pipeline("completer", "completion")
        # The one setting of another section that a completer looks at.
        asked["table_height_m"] = self.config.pipeline["metric"]["table_height_m"]
        return stage_key("complete", self.map, settings=asked)

    @property
    def target(self) -> str:
        """Which object of the map is the target."""
        return stage_key("target", self.map)

    @property
    def training(self) -> str:
        """The points that models learn from."""
        return stage_key("training", self.target, settings=self._pipeline("training"))

    @property
    def points(self) -> str:
        """The test points of all sets."""
        protocol = self.config.protocol
        made_of = self.completed if COMPLETED in protocol.test_sets else self.scene
        asked = [list(protocol.test_sets), protocol.test_points]
        return stage_key("test points", made_of, settings=asked)

    @property
    def distances(self) -> str:
        """Distance of each test point to each true mesh."""
        return stage_key("truth", self.points)

    def predictions(self, model: str) -> str:
        """Name what a model says of the test points."""
        settings = self._pipeline("gp", "recalibration")
        settings["gp"] = {key: value for key, value in settings["gp"].items() if key != "models"}
        settings["recalibration"] = settings["recalibration"].get(model)
        if model in EMBEDDING_MODELS:
            settings |= self._pipeline("metric")
        asked = [model, self.config.protocol.use_spread, settings]
        # The map itself tells the object's category and score.
        return stage_key("classify", self.training, self.points, settings=asked)

    def _pipeline(self, *sections: str) -> dict[str, Any]:
        return {section: self.config.pipeline[section] for section in sections}
