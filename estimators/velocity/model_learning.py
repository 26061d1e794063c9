"""Gains of actuators, damping, friction and load of a mechanism, found from its readings while it moves.

The equation of motion holds of quantities that are filtered alike. With a window w of 0.12 s, w ~ (1 - (t / T)^2)^3,

    q_w = int w q,    v_w = -int w' q,    a_w = int w'' q,    u_w = int w u

need no derivative of the readings. Every quarter of a window the torque tau that the model lacks, and the effect Phi of
its parameters theta (``mathnavi.models.mechanism.parameters``), are one sample of

    tau = Phi theta + e,

least squares with a prior N(0, D^2) of theta and with weights 1 / var(e_j) by joint, from what the last theta leaves of
the samples. Old samples are forgotten with a time constant of 20 s. Where a motion does not excite a parameter, it
keeps its prior, zero.

The parameters are **found** if they explain more of tau than chance does, one in 1e6 (chi-square, p degrees of
freedom), and all but an eighth of it, as what else a model lacks, or a motion that is too fast for the window, is not
explained; and if the torque that they add to a joint is more than 2 % of that of gains that are off by their prior
deviation. They are **known** if the torques that they add at the samples are known to a fifth, by the covariance of
theta. Found and not known is reason to doubt the model; known is reason to use another one.
"""

from __future__ import annotations

import math
from collections import deque

import numpy as np
from scipy.special import chdtri

from mathnavi.interfaces.signals import Array
from mathnavi.models.manifold.system import Step, UncertainParameters

_WINDOW, _FEWEST = 0.12, 24  # [s] and readings of a window, at least
_OFTEN = 4  # samples in a window
_UNEVEN = 1e-3  # of a step of time, beyond which readings are not evenly spaced
_MEMORY = 20.0  # [s]
_CHANCE = 1e-6
_UNEXPLAINED = 0.125  # of the torque that the model lacks, squared, that may be left
_MATTERS = 4.0  # times the least error of a sample, that the torque of parameters is
_KNOWN = 0.2  # of the torque that parameters add, to which it is known
_SOONEST, _BETWEEN = 8, 8  # samples before the first model and from one to the next
_SHARE = 5e-3  # of the torques of parameters that are off by a prior deviation: the error of a sample, at least
_CHANGED = 0.05  # of a prior deviation, by which a parameter has changed
_LEAST = 1e-12  # [N^2 m^2, N^2]


class ModelLearning:
    """Parameters of one mechanism, from readings (n,) with errors of given variances."""

    def __init__(self, parameters: UncertainParameters) -> None:
        self.parameters = parameters
        p = len(parameters.names)
        self._p = p
        self._past: deque[tuple[float, Array, Array]] = deque()
        self._kernel: tuple[Array, Array, Array, Array] | None = None
        self._h, self._since = 0.0, 0
        self._A: Array | None = None  # (n, p, p) sum of Phi_j' Phi_j, by joint
        self._b, self._squares = (
            np.zeros((0, p)),
            np.zeros((2, 0)),
        )  # sums of Phi_j' tau_j, and of tau_j^2 and its error
        self._touching = 0  # constraints of contacts and limits
        self._waiting: deque[tuple[Array, Array, Array]] = deque(maxlen=_OFTEN + 1)
        self._count: Array | float = 0.0  # (n,) of the samples that are not forgotten
        self._shares: Array | float = 0.0  # (n,) the sum of their shares
        self._samples, self._next = 0, _SOONEST
        self._limit = float(chdtri(p, _CHANCE))
        self.theta, self.used = np.zeros(p), np.zeros(p)
        """parameters (p,) by least squares, and those that the model was given last"""
        self.found = self.known = False

    def touch(self, count: int) -> None:
        """Note the number of contacts and limits that act: no window spans a change of it, across which a motion is not
        as smooth as its derivatives are taken to be.
        """
        if count != self._touching:
            self._past.clear()
            self._waiting.clear()
            self._touching = count

    def read(self, t: float, y: Array, u: Array) -> Step | None:
        """Take a reading y (nq,) of t [s], before which u (nu,) was held; return the step that is to be used from now
        on, if there is another one.
        """
        past = self._past
        h = t - past[-1][0] if past else 0.0
        if past and (self._h == 0.0 or abs(h - self._h) > _UNEVEN * self._h):
            if len(past) > 1:
                past.clear()
                self._waiting.clear()
            self._set_step(h)
        past.append((t, y, u))
        self._since += 1
        if self._kernel is None or len(past) < len(self._kernel[0]):
            return None
        while len(past) > len(self._kernel[0]):
            past.popleft()
        if self._since < len(past) // _OFTEN:
            return None
        self._since = 0
        return self._sample()

    def _set_step(self, h: float) -> None:
        """Weights of readings that are h [s] apart."""
        self._h = h
        if not h > 0.0:
            self._kernel = None
            return
        N = max(_FEWEST, round(_WINDOW / h)) + 1
        T = 0.5 * (N - 1) * h
        s = np.linspace(-1.0, 1.0, N)
        bump = 1.0 - s * s
        w, dw = bump**3, -6.0 * s * bump**2
        ddw = -6.0 * bump**2 + 24.0 * s * s * bump
        held = 0.5 * (s[1:] + s[:-1]) - self.parameters.delay / T  # u is that before a reading
        wu = np.append(0.0, np.maximum(1.0 - held * held, 0.0) ** 3)
        total = w.sum()
        v, a = -dw / (total * T), ddw / (total * T * T)
        v -= v.mean()  # of a position that stays, exactly; and of one that moves evenly
        v /= float(v @ (s * T))
        a -= a.mean()
        a *= 2.0 / float(a @ (s * T) ** 2)
        self._kernel = w / total, v, a, wu / wu.sum()

    def _sample(self) -> Step | None:
        assert self._kernel is not None
        w, dw, ddw, wu = self._kernel
        Y, U = np.array([each for _, each, _ in self._past]), np.array([each for _, _, each in self._past])
        middle = Y[len(Y) // 2]
        moved = Y - middle
        self._waiting.append(
            self.parameters.lacking(middle + w @ moved, dw @ moved, ddw @ moved, wu @ self.parameters.within(U))
        )
        if len(self._waiting) < _OFTEN + 1:
            return None
        tau, Phi, share = self._waiting[_OFTEN // 2]
        clear = np.logical_and.reduce([each > 0.0 for _, _, each in self._waiting])[:, np.newaxis]
        tau, Phi = tau * clear[:, 0], Phi * clear  # the windows of neighbours overlap
        D = self.parameters.prior
        if self._A is None:
            n = len(tau)
            self._A, self._b, self._squares = np.zeros((n, self._p, self._p)), np.zeros((n, self._p)), np.zeros((2, n))
        self._samples += 1
        kept = math.exp(-self._h * len(Y) / _OFTEN / _MEMORY)
        self._count = kept * self._count + clear[:, 0]
        self._shares = kept * self._shares + share * clear[:, 0]
        self._A *= kept
        self._A += Phi[:, :, np.newaxis] * Phi[:, np.newaxis]
        self._b = kept * self._b + Phi * tau[:, np.newaxis]
        least = (np.square(_SHARE * np.abs(Phi * D).max(axis=1)) + _LEAST) * clear[:, 0]
        self._squares = kept * self._squares + np.stack([np.square(tau), least])
        return self._solve()

    def _solve(self) -> Step | None:
        assert self._A is not None
        D, theta = self.parameters.prior, self.theta
        left = self._squares[0] - 2.0 * self._b @ theta + np.einsum("j,ijk,k->i", theta, self._A, theta)
        spread = np.maximum(left, self._squares[1]) / np.maximum(self._count, 1.0)
        share = self._shares / np.maximum(self._count, 1.0)  # rows of a closed chain repeat each other
        weight = share / (_OFTEN * np.maximum(spread, _LEAST))
        data = D[:, np.newaxis] * np.tensordot(weight, self._A, 1) * D  # of theta / D
        A = data + np.eye(self._p)
        inverse = np.linalg.inv(A)
        scaled = inverse @ (D * (weight @ self._b))
        self.theta = D * scaled
        if self._samples < _SOONEST:
            return None
        added = np.einsum("j,ijk,k->i", self.theta, self._A, self.theta)
        matters = bool((added > _MATTERS**2 * self._squares[1]).any())
        remaining = self._squares[0] - 2.0 * self._b @ self.theta + added
        least = self._squares[1] + _LEAST
        explained = float((remaining / least).sum()) <= _UNEXPLAINED * float((self._squares[0] / least).sum())
        self.found = matters and explained and float(scaled @ A @ scaled) > self._limit
        self.known = self.found and float(np.trace(inverse @ data)) <= _KNOWN**2 * float(scaled @ data @ scaled)
        if not self.known or (np.abs(self.theta - self.used) <= _CHANGED * D).all() or self._samples < self._next:
            return None
        self.used, self._next = self.theta.copy(), self._samples + _BETWEEN
        return self.parameters.applied(self.theta)
