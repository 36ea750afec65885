# Copyright 2026 The robot_dynamics authors
#
# Licensed under the Apache License, Version 2.0 (the "License");
# you may not use this file except in compliance with the License.
# You may obtain a copy of the License at
#
#     http://www.apache.org/licenses/LICENSE-2.0
#
# Unless required by applicable law or agreed to in writing, software
# distributed under the License is distributed on an "AS IS" BASIS,
# WITHOUT WARRANTIES OR CONDITIONS OF ANY KIND, either express or implied.
# See the License for the specific language governing permissions and
# limitations under the License.

"""Identification of the parameters of an arm from recordings."""

from robot_dynamics.identification.bag_identification import BagIdentification, identify_bags
from robot_dynamics.identification.pipeline import Identification, identify
from robot_dynamics.identification.tasks import IdentificationSettings

__all__ = [
    'BagIdentification',
    'Identification',
    'IdentificationSettings',
    'identify',
    'identify_bags',
]
