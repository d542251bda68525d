"use strict";
// The rebound of a sphere from a wall in one formula: k = a + min(b, kappa U_n/|U_t|), the tangential
// impulse per mass and incoming speed is -k U_t. A line of this file is a line of ifrfit/physics.
const ifrfit = (() => {
  const RADIAN = Math.PI / 180;

  // sine and cosine keep their digits near 90 degrees, where 90 - gamma is exact
  function incidence(gamma, spinX, spinY) {
    const steep = gamma > 45;
    const small = steep ? 90 - gamma : gamma;
    const s = small === 30 ? 0.5 : Math.sin(small * RADIAN);
    const c = small === 45 ? s : Math.cos(small * RADIAN);
    const sine = steep ? c : s;
    const cosine = steep ? s : c;
    const slipX = sine + spinY;
    return { sine, cosine, spinX, spinY, slipX, slipY: spinX, slip: Math.hypot(slipX, spinX) };
  }

  function rebound(i, closure, eN, c, mu, inertia) {
    const a = closure.a[0] + closure.a[1] * c;
    const b = closure.b[0] + closure.b[1] * c;
    const friction = i.slip === 0 ? Infinity : (mu * (1 + eN) * i.cosine) / i.slip;
    const k = a + Math.min(b, friction);
    const share = inertia / (1 + inertia);
    const pushX = k * i.slipX;
    const pushY = k * i.slipY;
    return {
      k, share, eN, mu, i,
      sticking: friction >= b,
      vX: i.sine - pushX,
      vY: 0 - pushY,
      vN: eN * i.cosine,
      spinX: i.spinX - pushY / inertia,
      spinY: i.spinY - pushX / inertia,
      contactX: i.slipX - pushX / share,
      contactY: i.slipY - pushY / share,
    };
  }

  const ratio = (over, under) => (under === 0 ? NaN : over / under);
  const degrees = (y, x) => (y === 0 && x === 0 ? NaN : Math.atan2(y, x) / RADIAN);

  // name: (r) => expression; the page writes in those of ifrfit/physics/observables.py
  const OBSERVABLES = {/* observables */};

  function value(observable, gamma, spinX, spinY, closure, eN, c, mu, inertia) {
    const i = incidence(gamma === null ? 0 : gamma, spinX, spinY);
    return OBSERVABLES[observable](rebound(i, closure, eN, c, mu, inertia));
  }

  // incidence angles at which |U_t|/U_n = tau: the roots of (1 + tau^2) S^2 + 2 s_y S + s_x^2 + s_y^2 - tau^2
  function transitions(closure, eN, c, mu, spinX, spinY) {
    const bound = closure.b[0] + closure.b[1] * c;
    const tau = bound > 0 ? (mu * (1 + eN)) / bound : Infinity;
    if (!isFinite(tau)) return [];
    const n = Math.hypot(1, tau);
    const p = tau / n;
    const spin = Math.hypot(spinX, spinY) / n;
    const lateral = Math.abs(spinX) / n / n;
    if (spin > 1) return [];
    const reach = p * Math.sqrt((1 - spin) * (1 + spin));
    if (reach < lateral) return [];
    const half = spinY / n / n;
    const root = Math.sqrt(reach - lateral) * Math.sqrt(reach + lateral);
    const first = -half - (half < 0 || Object.is(half, -0) ? -root : root);
    const second = first !== 0 ? ((spin - p) / first) * (spin + p) : 0;
    const sines = [first, second].filter((s) => s >= 0 && s <= 1 + 1e-15).map((s) => Math.min(Math.abs(s), 1));
    const angles = sines.map((s) =>
      Math.sqrt((1 - s) * (1 + s)) >= tau
        ? Math.asin(s) / RADIAN
        : Math.atan2(s, Math.hypot(s + spinY, spinX) / tau) / RADIAN,
    );
    return [...new Set(angles)].sort((x, y) => x - y);
  }

  return { incidence, rebound, value, transitions, OBSERVABLES };
})();
