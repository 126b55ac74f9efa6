"""From commands, gyro and potentiometer to a continuous-time model with honest uncertainty."""

from analysis.identify.errors import IdentificationError
from analysis.identify.evidence import AxisEvidence, ChannelFit, Estimate, ServoBounds
from analysis.identify.gimbal import cross_gains, identify_gimbal, own_records
from analysis.identify.identification import identify
from analysis.identify.model import IdentifiedModel
from analysis.identify.order import OrderScore, select_order
from analysis.identify.prediction import fit_to, predict
from analysis.identify.recordings import from_recording
from analysis.recording.record import Record, merge_stamps, record

__all__ = [
    "AxisEvidence",
    "ChannelFit",
    "Estimate",
    "IdentificationError",
    "IdentifiedModel",
    "OrderScore",
    "Record",
    "ServoBounds",
    "cross_gains",
    "fit_to",
    "from_recording",
    "identify",
    "identify_gimbal",
    "merge_stamps",
    "own_records",
    "predict",
    "record",
    "select_order",
]
