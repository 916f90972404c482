const LIGHTS = robot.lights.length, DISTANCES = robot.distances.length;  // sensor readings are in this order

// The network: inputs and the bias, hidden layers, wheels; genes layer by layer, a row for each presynaptic neuron.
// A wiring has its list of synapses instead (`joined`), and the activations of its neurons are recorded.
const RIM = LIGHTS + DISTANCES;  // sensors of the user's own follow those on the rim
const INPUTS = layers[0], BIAS = INPUTS, layerSizes = [INPUTS + 1, ...layers.slice(1)];
const OWN_END = INPUTS - (data.hasTrials ? 1 : 0);
const firstNeuron = layerSizes.map((_, layer) => layerSizes.slice(0, layer).reduce((sum, n) => sum + n, 0));
const NEURONS = layerSizes.reduce((sum, n) => sum + n, 0), WHEELS = NEURONS - 2;
const SPIKING = data.spiking, TICK = { width: 2, height: 7 };  // the first of these neurons spike; pixels of a tick
const OWN = data.joined ? NEURONS - INPUTS - 1 : 0;  // neurons whose activations are recorded

const [pre, post] = data.joined ?? [[], []];
for (let layer = 1; layer < layers.length && !data.joined; layer++) {
  for (let i = 0; i < layerSizes[layer - 1]; i++) {
    for (let j = 0; j < layerSizes[layer]; j++) {
      pre.push(firstNeuron[layer - 1] + i);
      post.push(firstNeuron[layer] + j);
    }
  }
}
const GENES = pre.length;
const columnOf = layerSizes.flatMap((size, layer) => Array(size).fill(layer));
const neuronNames = [
  ...data.inputs, "constant 1",
  ...layers.slice(1, -1).flatMap((size, layer) => Array.from({ length: size }, (_, i) => `hidden ${layer + 1}.${i + 1}`)),
  "left wheel", "right wheel",
];

/** Activations of all neurons at sample k, with the weights before that step's update. */
function activations(life, k) {
  const activation = new Float64Array(NEURONS), drive = new Float64Array(NEURONS);
  for (let i = 0; i < INPUTS; i++) activation[i] = life.sensors[sampleAt(k) * INPUTS + i];
  activation[BIAS] = 1;
  if (data.joined) {
    activation.set(life.activations.subarray(sampleAt(k) * OWN, (sampleAt(k) + 1) * OWN), BIAS + 1);
    return activation;
  }
  const part = (data.steps - 1) / data.steps;
  for (let gene = 0, done = INPUTS + 1; gene < GENES; gene++) {
    for (; done <= pre[gene]; done++) activation[done] = Math.tanh(drive[done]);
    const now = life.change[changeAt(k) * GENES + gene], before = k ? life.change[changeAt(k - 1) * GENES + gene] : 0;
    drive[post[gene]] += activation[pre[gene]] * (data.initial[gene] + (k ? before + part * (now - before) : 0));
  }
  for (let wheel = WHEELS; wheel < NEURONS; wheel++) activation[wheel] = Math.tanh(drive[wheel]);
  return activation;
}

/** The pose at time t, on the straight line between two samples; a robot that is reset stays until then. */
function poseAt(life, t) {
  const k = Math.min(samples - 1, Math.floor(t / data.interval + 1e-6));
  const next = life.resets.includes(k + 1) ? k : Math.min(samples - 1, k + 1);
  const part = Math.max(0, t / data.interval - k), between = (values) => values[sampleAt(k)] + part * (values[sampleAt(next)] - values[sampleAt(k)]);
  return { k, x: between(life.x), y: between(life.y), heading: between(life.heading) };
}

/** Number of the world of a robot at time t: how many changes have begun for it. */
function worldNumber(life, t) {
  return life.begins.filter((since) => since !== null && since <= t + 1e-6).length - 1;
}

const worldAt = (life, t) => data.worlds[worldNumber(life, t)];

/** A robot's network. */
class Network {
  constructor(c) {
    this.c = c;
    this.canvases = stack();
    this.tip = element("p", { className: "tip" });
    const meaning = "Spikes: a row for each neuron, a column for each recorded step; the darker, the more substeps had one";
    this.raster = element("canvas", { hidden: !SPIKING, role: "img", title: meaning });
    const title = data.controllers[c], canvas = this.canvases.above;
    canvas.tabIndex = 0;
    canvas.setAttribute("aria-label", `${title}: its network of ${NEURONS} neurons and ${GENES} connections; up and down keys select a connection`);
    this.figure = element("figure", { className: "network" },
      element("figcaption", {}, element("h3", { textContent: title })),
      this.canvases.both, this.raster, this.tip);
    $("networks")?.append(this.figure);
    canvas.addEventListener("pointermove", (event) => this.point(this.nearest(event.offsetX, event.offsetY)));
    canvas.addEventListener("pointerdown", (event) => this.point(this.nearest(event.offsetX, event.offsetY)));
    canvas.addEventListener("pointerleave", () => this.point(null));
    canvas.addEventListener("blur", () => this.point(null));
    canvas.addEventListener("keydown", (event) => {
      const by = { ArrowDown: 1, ArrowUp: -1 }[event.key];
      if (!by) return;
      event.preventDefault();
      this.point(this.gene === null ? 0 : (this.gene + by + GENES) % GENES);
      $("said").textContent = this.text();
    });
    this.gene = null;
  }

  /** How high it is drawn for a width. */
  height(width) {
    return Math.max(250, Math.min(360, 0.6 * width), Math.min(560, 10.5 * Math.max(...layerSizes)));
  }

  resize() {
    const rows = Math.max(...layerSizes), heightOf = (width) => this.height(width);
    this.linesPen = fit(this.canvases.below, heightOf);
    this.pen = fit(this.canvases.above, heightOf);
    const width = this.canvases.above.clientWidth, height = heightOf(width);
    this.isNarrow = width < 240;  // then it has no labels
    const [left, right] = this.isNarrow ? [8, width - 8] : [76, width - 44];
    this.neuronRadius = Math.min(8, 0.4 * (height - 8) / rows);
    this.x = [];
    this.y = [];
    layerSizes.forEach((size, layer) => {
      const gap = Math.min((height - 8) / rows * (layer ? 2 : 1), (height - 8) / size);
      for (let i = 0; i < size; i++) {
        this.x.push(left + (right - left) * layer / (layerSizes.length - 1));
        this.y.push(height / 2 + (i - (size - 1) / 2) * gap);
      }
    });
    this.linesAt = this.neuronsAt = null;
    this.rasterPen = SPIKING && fit(this.raster, () => SPIKING * TICK.height + 16);
  }

  /** The connection within 7 pixels of a point, or null. */
  nearest(x, y) {
    let best = null, least = 7;
    for (let gene = 0; gene < GENES; gene++) {
      const points = this.path(gene);
      for (let i = 1; i < points.length; i++) {
        const [[x0, y0], [x1, y1]] = [points[i - 1], points[i]];
        const part = Math.max(0, Math.min(1, ((x - x0) * (x1 - x0) + (y - y0) * (y1 - y0)) / ((x1 - x0) ** 2 + (y1 - y0) ** 2)));
        const distance = Math.hypot(x - x0 - part * (x1 - x0), y - y0 - part * (y1 - y0));
        if (distance < least) [best, least] = [gene, distance];
      }
    }
    return best;
  }

  /** The points of a connection: a straight line ahead; an arc to the same or an earlier column, aside of its reverse. */
  path(gene) {
    const [from, to] = [pre[gene], post[gene]], [x0, y0, x1, y1] = [this.x[from], this.y[from], this.x[to], this.y[to]];
    if (columnOf[to] > columnOf[from]) return [[x0, y0], [x1, y1]];
    const [width, height] = from === to ? [0, 3 * this.neuronRadius] : [x1 - x0, y1 - y0];
    const around = from === to ? 1 : 0.5;  // an arc on itself is a loop
    return Array.from({ length: 9 }, (_, i) => {
      const part = i / 8, aside = around * Math.sin(Math.PI * part), along = from === to ? Math.sin(2 * Math.PI * part) / 3 : part;
      return [x0 + along * width + aside * height, y0 + along * height - aside * width / 2];
    });
  }

  point(gene) {
    this.gene = gene;
    this.neuronsAt = null;
    redraw();
  }

  /** The selected connection in words. */
  text() {
    const life = lifetimes[shown.side][this.c], { k } = poseAt(life, shown.t), gene = this.gene;
    if (gene === null) return "";
    const change = life.change[changeAt(k) * GENES + gene], weight = data.initial[gene] + change;
    return `Gene ${gene}: from ${neuronNames[pre[gene]]} to ${neuronNames[post[gene]]}. ` +
      `Weight ${signed(weight, 4)}, changed by ${signed(change, 4)} from its initial value.`;
  }

  draw(now) {
    const life = lifetimes[shown.side][this.c], { k } = poseAt(life, shown.t);
    // Weights change slowly, and lines are the slowest to draw: ten times a second is enough.
    const due = !shown.playing || now - this.linesDrawn > 100;
    if (this.linesAt === null || (k !== this.linesAt && due && !life.isFixed)) {
      this.drawLines(life, k);
      this.linesDrawn = now;
    }
    if (k === this.neuronsAt) return;
    this.drawNeurons(life, k);
    if (SPIKING) this.drawSpikes(life, k);
  }

  /** Draw a row for each neuron, and a column for each sample until now. */
  drawSpikes(life, k) {
    const pen = this.rasterPen, right = this.raster.clientWidth, columns = Math.floor((right - this.x[0]) / TICK.width);
    pen.clearRect(0, 0, this.raster.width, this.raster.height);
    pen.fillStyle = colours.soft;
    pen.fillText(`spikes of the last ${(columns * data.interval).toFixed(0)} s`, this.x[0], SPIKING * TICK.height + 12);
    pen.fillStyle = colours.ink;
    for (let past = 0; past < columns && k - past >= 0; past++) {
      for (let i = 0; i < SPIKING; i++) {
        pen.globalAlpha = Math.min(1, 2 * life.activations[sampleAt(k - past) * OWN + i]);
        pen.fillRect(right - (past + 1) * TICK.width, i * TICK.height, TICK.width, TICK.height - 1);
      }
    }
    pen.globalAlpha = 1;
  }

  drawLines(life, k) {
    this.linesAt = k;
    const pen = this.linesPen;
    pen.clearRect(0, 0, this.canvases.below.width, this.canvases.below.height);
    const changes = Array.from(life.change.subarray(changeAt(k) * GENES, (changeAt(k) + 1) * GENES), (change, gene) => ({ gene, change }));
    for (const { gene, change } of changes.sort((a, b) => Math.abs(a.change) - Math.abs(b.change))) {
      const part = mostChange && Math.sqrt(Math.abs(change) / mostChange);  // the square root makes small changes visible
      if (part < 0.06) this.line(pen, gene, colours.line, 1, 1);
      else this.line(pen, gene, change > 0 ? colours.rose : colours.fell, 0.5 + 2.5 * part, 0.15 + 0.85 * part);
    }
  }

  line(pen, gene, style, width, alpha) {
    pen.strokeStyle = style;
    pen.lineWidth = width;
    pen.globalAlpha = alpha;
    pen.beginPath();
    for (const [x, y] of this.path(gene)) pen.lineTo(x, y);
    pen.stroke();
    pen.globalAlpha = 1;
  }

  drawNeurons(life, k) {
    this.neuronsAt = k;
    const pen = this.pen;
    pen.clearRect(0, 0, this.canvases.above.width, this.canvases.above.height);
    if (this.gene !== null) this.line(pen, this.gene, colours.ink, 3, 1);
    activations(life, k).forEach((activation, neuron) => {
      const x = this.x[neuron], y = this.y[neuron], size = this.neuronRadius;
      disc(pen, x, y, size);
      pen.fillStyle = colours.card;
      pen.strokeStyle = colours.soft;
      pen.lineWidth = 1;
      pen.fill();
      pen.stroke();
      const inner = (size - 1.5) * Math.sqrt(Math.min(1, Math.abs(activation)));
      pen.fillStyle = pen.strokeStyle = colours.ink;
      if (activation > 0) {
        disc(pen, x, y, inner);
        pen.fill();
      } else {
        pen.lineWidth = Math.min(2, inner);
        disc(pen, x, y, Math.max(0, inner - pen.lineWidth / 2));
        if (inner > 0.5) pen.stroke();
      }
    });
    this.tip.textContent = this.text();
    if (this.isNarrow) return;
    pen.fillStyle = colours.soft;
    pen.textBaseline = "middle";
    pen.textAlign = "right";
    const groups = [["light", 0, LIGHTS - 1], ["distance", LIGHTS, RIM - 1], ...(RIM < OWN_END ? [["added", RIM, OWN_END - 1]] : [])];
    const labels = groups.map(([text, first, last]) => [text, (first + last) / 2]);
    for (const [text, neuron] of [...labels, ["constant 1", BIAS], ...(data.hasTrials ? [["reward", INPUTS - 1]] : [])]) {
      pen.fillText(text, this.x[0] - 16, (this.y[Math.floor(neuron)] + this.y[Math.ceil(neuron)]) / 2);
    }
    pen.strokeStyle = colours.soft;
    pen.lineWidth = 1;
    for (const [, first, last] of groups) {
      const x = this.x[0] - 12;
      pen.strokeRect(x, this.y[first] - 3, 0, this.y[last] - this.y[first] + 6);
    }
    pen.textAlign = "left";
    const roomy = this.y[WHEELS + 1] - this.y[WHEELS] > 26;
    ["left", "right"].forEach((text, i) => {
      pen.fillText(text, this.x[WHEELS + i] + 12, this.y[WHEELS + i] - (roomy ? 6 : 0));
      if (roomy) pen.fillText("wheel", this.x[WHEELS + i] + 12, this.y[WHEELS + i] + 6);
    });
  }
}
