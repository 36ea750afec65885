# SPDX-FileCopyrightText: 2026 The robot_dynamics authors
# SPDX-License-Identifier: Apache-2.0

"""Identification of the parameters of an arm from recordings."""

from robot_dynamics_tools.identification.bag_identification import (
    BagIdentification,
    IdentificationSettings,
    identify_bags,
)
from robot_dynamics_tools.identification.pipeline import Identification, identify

__all__ = [
    'BagIdentification',
    'Identification',
    'IdentificationSettings',
    'identify',
    'identify_bags',
]
