// ---- What is recorded ----

const WIDTHS = { x: 1, y: 1, heading: 1, sensors: INPUTS, activations: OWN, left: 1, right: 1, fitness: 1, changeSignal: 1, rate: 1, weightChange: 1 };
const ROW = Object.values(WIDTHS).reduce((sum, width) => sum + width, 0);
const FARTHEST = 3 * data.speed / 100 * data.interval;  // m that a robot can drive in a step; farther, it was put there
const sampleAt = (k) => k;
const changeAt = (k) => Math.floor(k / data.weightsEvery);  // where the weights of sample k are
let samples = 1, END = 0, mostChange = 0;
const store = data.controllers.map(() => Object.fromEntries([
  ...Object.entries(WIDTHS).map(([name, width]) => [name, new Float32Array(data.most * width)]),
  ["change", new Float32Array(Math.ceil(data.most / data.weightsEvery) * GENES)],
]));
const own = data.controllers.map((_, c) => ({ arrival: null, visits: [], stayed: false, isFixed: false, resets: [], begins: [0], ...store[c] }));
const lifetimes = { [data.sides[0]]: own };
const highest = {}, lowest = {};
const ends = (name) => [lowest[name] ?? 0, highest[name] ?? 0];
const sunChanges = true;

/** Take the numbers of some steps; see `samples` in page.py. */
function take(payload) {
  const [since, count, ofWeights] = new Uint32Array(payload.buffer, 0, 3), values = new Float32Array(payload.buffer, 12);
  let at = 0;
  store.forEach((kept, c) => {
    for (let k = since; k < since + count; k++) {
      for (const [name, width] of Object.entries(WIDTHS)) {
        kept[name].set(values.subarray(at, at + width), k * width);
        if (width === 1) {
          highest[name] = Math.max(highest[name] ?? 0, values[at]);
          lowest[name] = Math.min(lowest[name] ?? 0, values[at]);
        }
        at += width;
      }
      if (k > 0 && Math.hypot(kept.x[k] - kept.x[k - 1], kept.y[k] - kept.y[k - 1]) > FARTHEST) own[c].resets.push(k);
    }
    const weights = values.subarray(at, at + ofWeights * GENES);
    for (let i = 0; i < ofWeights; i++) {
      kept.change.set(weights.subarray(i * GENES, (i + 1) * GENES), changeAt(since + data.weightsEvery * (i + 1) - 1) * GENES);
    }
    for (const value of weights.subarray(-GENES)) mostChange = Math.max(mostChange, Math.abs(value));
    at += ofWeights * GENES;
  });
  samples = Math.max(1, since + count);
  END = (samples - 1) * data.interval;
  notice(since);
  judge();
}

data.worlds = [data.world];
data.changes = [];
const shown = { side: data.sides[0], t: 0, playing: data.playing, speed: data.speed };
