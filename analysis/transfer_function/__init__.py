"""The identified model of a gimbal: its file, its exact discretisation, its responses."""

from analysis.transfer_function.channel import Channel
from analysis.transfer_function.covariance import Covariance
from analysis.transfer_function.discrete import (
    Discrete,
    DiscreteChannel,
    discretise_channel,
    realise,
    whole_steps,
)
from analysis.transfer_function.file import SCHEMA, ModelFileError
from analysis.transfer_function.margins import Loop, Margins, margins
from analysis.transfer_function.model import TransferFunctionModel
from analysis.transfer_function.servo import Servo, speed_loop
from analysis.transfer_function.uncertain import distribution, with_figures

__all__ = [
    "SCHEMA",
    "Channel",
    "Covariance",
    "Discrete",
    "DiscreteChannel",
    "Loop",
    "Margins",
    "ModelFileError",
    "Servo",
    "TransferFunctionModel",
    "discretise_channel",
    "distribution",
    "margins",
    "realise",
    "speed_loop",
    "whole_steps",
    "with_figures",
]
