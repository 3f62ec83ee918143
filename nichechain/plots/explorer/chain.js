"use strict";

/* What the page holds. */

const data = JSON.parse(document.getElementById("data").textContent);
const unpack = (text, Kind) => new Kind(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
const [columns, rows] = data.shape;
const n = data.niches;
const S = data.states;
const LONGEST = 10;
const FEW = 20;
const T = {
  start: unpack(data.rowStart, Uint32Array),
  column: unpack(data.column, Uint16Array),
  probability: unpack(data.probability, Float32Array),
  shares: unpack(data.shares, Float32Array),
  pools: unpack(data.pools, Float32Array),
  spread: unpack(data.spread, Float32Array),
  kernel: unpack(data.kernel, Float32Array),
};
const returns = unpack(data.returns, Float64Array);
const counts = {
  start: unpack(data.countStart, Uint32Array),
  column: unpack(data.countColumn, Uint16Array),
  count: unpack(data.count, Uint32Array),
};
const visits = unpack(data.visits, Uint32Array);
const children = unpack(data.children, Uint32Array);
const elites = unpack(data.elites, Float64Array);
const scores = unpack(data.scores, Float32Array);
const wormholes = new Map((data.wormholes || []).map(([i, j, p]) => [i * S + j, p]));
const [[left, right], [bottom, top]] = data.bounds;
const cell = [(right - left) / columns, (top - bottom) / rows];
const far = data.longJump * Math.hypot(right - left, top - bottom);

const elite = (field, niche) => elites[field * n + niche];
const index = (niche) => [Math.floor(niche / rows), niche % rows];
const label = (state) => (state < n ? index(state).join(",") : "outside");
const center = (niche) => {
  const [i, j] = index(niche);
  return [left + (i + 0.5) * cell[0], bottom + (j + 0.5) * cell[1]];
};
const distance = (a, b) => Math.hypot(center(a)[0] - center(b)[0], center(a)[1] - center(b)[1]);

/* The chain. */

/**
 * Distribution of a lineage's next state, given that of its present one. T has three parts: what
 * births say, where children land anywhere, and how far they land from their parents.
 */
function advance(here) {
  const there = new Float64Array(S);
  const pools = T.pools.length / S;
  for (let pool = 0; pool < pools; pool++) {
    let pooled = 0;
    for (let i = 0; i < S; i++) pooled += here[i] * T.shares[i * pools + pool];
    for (let j = 0; j < S; j++) there[j] += pooled * T.pools[pool * S + j];
  }
  for (let i = 0; i < S; i++) {
    if (here[i] === 0) continue;
    for (let k = T.start[i]; k < T.start[i + 1]; k++) there[T.column[k]] += here[i] * T.probability[k];
    const spread = here[i] * T.spread[i];
    if (spread === 0) continue;
    const [x, y] = index(i);
    for (let column = 0, j = 0; column < columns; column++) {
      const offset = (column - x + columns - 1) * (2 * rows - 1) + rows - 1 - y;
      for (let line = 0; line < rows; line++, j++) there[j] += spread * T.kernel[offset + line];
    }
  }
  return there;
}

/** A row of T. */
function row(state) {
  const here = new Float64Array(S);
  here[state] = 1;
  return advance(here);
}

/**
 * h[g - 1][j]: probability that a lineage of g generations from a niche visits state j.
 * A visit at step k is the first one, or a first one at step i and a return after k - i steps.
 */
function visitProbabilities(root) {
  const present = [row(root)];
  while (present.length < LONGEST) present.push(advance(present[present.length - 1]));
  const first = [];
  const h = [];
  for (let k = 0; k < LONGEST; k++) {
    const fresh = present[k].slice();
    for (let i = 0; i < k; i++) {
      const back = (k - i - 1) * S;
      for (let j = 0; j < S; j++) fresh[j] -= first[i][j] * returns[back + j];
    }
    for (let j = 0; j < S; j++) fresh[j] = Math.max(0, fresh[j]);
    first.push(fresh);
    h.push(k ? fresh.map((p, j) => Math.min(1, p + h[k - 1][j])) : fresh);
  }
  return h;
}

/** Probability that at least one of U lineages does what one does with probability p. */
const atLeastOne = (p, U) => -Math.expm1(U * Math.log1p(-Math.min(p, 1)));
const coverage = (h, U) => {
  let sum = 0;
  for (let j = 0; j < n; j++) sum += atLeastOne(h[j], U);
  return sum;
};

/** Mean (0), 5 % (1) or 95 % (2) quantile over posterior draws; undefined where U has none. */
function score(which, niche, l, U) {
  const u = data.sizes.indexOf(U);
  return u < 0 ? undefined : scores[((which * data.sizes.length + u) * LONGEST + l - 1) * n + niche];
}
