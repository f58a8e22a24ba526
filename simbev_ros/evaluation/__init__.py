"""Compares the predictions of perception stacks with the ground truth, and computes metrics and tables."""

from typing import TYPE_CHECKING

from simbev_ros.foundation.lazy import lazy_names

if TYPE_CHECKING:
    from simbev_ros.evaluation.metrics.boxes import Predictions
    from simbev_ros.evaluation.predictions.prediction_writer import write_grid, write_predictions

__all__ = ["Predictions", "write_grid", "write_predictions"]
__getattr__ = lazy_names(
    __name__,
    {
        "Predictions": "metrics.boxes",
        "write_grid": "predictions.prediction_writer",
        "write_predictions": "predictions.prediction_writer",
    },
)
