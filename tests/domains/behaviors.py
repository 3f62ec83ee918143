"""Descriptors that tests name by module and function."""

from __future__ import annotations

import numpy as np


def feet_contacts(episode):
    """Share of steps in which each foot of Ant-v5 touches something, (4,).

    Its observations end with the contact forces on 13 bodies, six numbers each, the feet among
    them being bodies 3, 6, 9 and 12.
    """
    forces = episode.observations[1:, 27:].reshape(len(episode.actions), 13, 6)
    return (forces[:, [3, 6, 9, 12]] != 0).any(axis=2).mean(axis=0)


def three_numbers(episode):
    return episode.observations[-1, :3]


def not_a_number(episode):
    return [np.nan, episode.rewards[0]]


class Holder:
    @staticmethod
    def first_two(episode):
        return episode.observations[-1, :2]


NUMBER = 7
