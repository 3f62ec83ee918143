"use strict";

/* What the page holds. */

const data = JSON.parse(document.getElementById("data").textContent);
const unpack = (text, Kind) => new Kind(Uint8Array.from(atob(text), (c) => c.charCodeAt(0)).buffer);
// A grid has columns and rows; other niches are Voronoi cells around their centres.
const [columns, rows] = data.shape || [0, 0];
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
  known: unpack(data.known, Uint8Array),
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
const scoreScale = unpack(data.scoreScale, Float32Array);
const scores = unpack(data.scores, Uint16Array);
const past = {
  visits: unpack(data.visitsAt, Uint32Array),
  children: unpack(data.childrenAt, Uint32Array),
  first: unpack(data.firstBirth, Uint32Array),
  parent: unpack(data.ancestorParent, Int32Array),
  niche: unpack(data.ancestorNiche, Uint16Array),
  elite: unpack(data.eliteBirth, Int32Array),
};
const centers = unpack(data.centers, Float64Array);
const corners = data.shape ? null : { start: unpack(data.cornerStart, Uint32Array), at: unpack(data.corners, Float32Array) };
const wormholes = new Map((data.wormholes || []).map(([i, j, p]) => [i * S + j, p]));
const [[left, right], [bottom, top]] = data.bounds;
// Width and height of a cell, on average where cells differ.
const cell = data.shape
  ? [(right - left) / columns, (top - bottom) / rows]
  : [(right - left) / Math.sqrt(n), (top - bottom) / Math.sqrt(n)];
const far = data.longJump * Math.hypot(right - left, top - bottom);

const elite = (field, niche) => elites[field * n + niche];
const index = (niche) => [Math.floor(niche / rows), niche % rows];
const label = (state) => (state >= n ? "outside" : data.shape ? index(state).join(",") : String(state));
const center = (niche) => [centers[2 * niche], centers[2 * niche + 1]];

/** The corners of a niche's cell. */
function outline(niche) {
  if (corners) {
    const found = [];
    for (let k = corners.start[niche]; k < corners.start[niche + 1]; k++) found.push([corners.at[2 * k], corners.at[2 * k + 1]]);
    return found;
  }
  const [i, j] = index(niche);
  const [x, y] = [left + i * cell[0], bottom + j * cell[1]];
  return [[x, y], [x + cell[0], y], [x + cell[0], y + cell[1]], [x, y + cell[1]]];
}
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
      for (let line = 0; line < rows; line++, j++)
        if (T.known[j] || j === i) there[j] += spread * T.kernel[offset + line];
    }
  }
  return there;
}

/** T_ij, whose parts are added up. */
function entry(i, j) {
  const pools = T.pools.length / S;
  let found = 0;
  for (let pool = 0; pool < pools; pool++) found += T.shares[i * pools + pool] * T.pools[pool * S + j];
  for (let k = T.start[i]; k < T.start[i + 1]; k++) if (T.column[k] === j) found += T.probability[k];
  if (T.spread[i] && j < n && (T.known[j] || j === i)) {
    const [[x, y], [column, line]] = [index(i), index(j)];
    found += T.spread[i] * T.kernel[(column - x + columns - 1) * (2 * rows - 1) + rows - 1 - y + line];
  }
  return found;
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

/** Niches reached: mean (0), 5 % (1) or 95 % (2) quantile over posterior draws, at a stop U. */
function score(which, niche, l, U) {
  const block = (which * data.sizes.length + data.sizes.indexOf(U)) * LONGEST + l - 1;
  return (scores[block * n + niche] * scoreScale[block]) / 65535;
}

/** States that an elite's lineage went through, from its first ancestor on; none where there is no elite. */
function lineage(niche) {
  const found = [];
  for (let birth = past.elite[niche]; birth >= 0; birth = past.parent[birth]) found.push(past.niche[birth]);
  return found.reverse();
}
