"""From commands, gyro and potentiometer to a continuous-time model with honest uncertainty."""

from analysis.identify.design import FIGURES, Plant, Wish, remaining
from analysis.identify.errors import IdentificationError
from analysis.identify.evidence.evidence import AxisEvidence, ChannelFit, Estimate, ServoBounds
from analysis.identify.frozen import without_frozen
from analysis.identify.gimbal import cross_gains, identify_gimbal, own_records
from analysis.identify.identification import identify
from analysis.identify.information import Expectation, expectations
from analysis.identify.model import IdentifiedModel
from analysis.identify.order import OrderScore, select_order
from analysis.identify.prediction import fit_to, predict
from analysis.identify.pulses import by_frames, by_pulses

__all__ = [
    "FIGURES",
    "AxisEvidence",
    "ChannelFit",
    "Estimate",
    "Expectation",
    "IdentificationError",
    "IdentifiedModel",
    "OrderScore",
    "Plant",
    "ServoBounds",
    "Wish",
    "by_frames",
    "by_pulses",
    "cross_gains",
    "expectations",
    "fit_to",
    "identify",
    "identify_gimbal",
    "own_records",
    "predict",
    "remaining",
    "select_order",
    "without_frozen",
]
