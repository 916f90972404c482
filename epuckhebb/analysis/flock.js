// ---- The picture of a flock; the page has `robots`, `radius` and `data.knowers` ----

const STRONG = 0.15;  // share of a robot's attention from which a coupling is drawn

function disc(pen, x, y, radius) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
}

/** A flock with one coupling. A subclass has `poses`, `weightsAt`, `brokenAt` and `cosineAt`, each of a time [s]. */
class FlockPicture {
  constructor(name, tallest) {
    Object.assign(this, { name, tallest, selected: null, isHeld: false });
    this.canvas = element("canvas", { role: "img" });
    this.now = element("p", { className: "now" });
    this.title = element("h3", { textContent: name });
    $("flocks").append(element("figure", {}, element("figcaption", {}, this.title), this.canvas, this.now));
  }

  resize() {
    this.height = Math.min(this.tallest, this.canvas.clientWidth * 0.8);
    this.pen = fit(this.canvas, () => this.height);
  }

  /** The strongest couplings: listener, speaker and share of the listener's attention. */
  links(t) {
    const weights = this.weightsAt(t), found = [];
    for (let i = 0; i < robots; i++) {
      const row = weights.slice(i * robots, (i + 1) * robots), sum = row.reduce((a, b) => a + b, 0);
      row.forEach((weight, j) => { if (weight > STRONG * sum) found.push({ listener: i, speaker: j, share: weight / sum }); });
    }
    return found;
  }

  draw(t) {
    const pen = this.pen, width = this.canvas.clientWidth, height = this.height, poses = this.poses(t);
    const middle = (axis) => { const sorted = poses.map((pose) => pose[axis]).sort((a, b) => a - b); return (sorted[(robots - 1) >> 1] + sorted[robots >> 1]) / 2; };
    const x0 = middle("x"), y0 = middle("y"), lame = this.brokenAt(t);
    const away = poses.map(({ x, y }) => Math.max(Math.abs(x - x0) / width * height, Math.abs(y - y0)))
      .filter((far, i) => i !== lame || far < 1);
    const half = Math.min(2, Math.max(0.5, Math.max(...away) + 0.15));
    if (!this.isHeld) this.frame = { x: x0, y: y0, scale: height / 2 / half };
    const { scale } = this.frame, X = (x) => width / 2 + (x - this.frame.x) * scale, Y = (y) => height / 2 - (y - this.frame.y) * scale;
    const left = this.frame.x - width / 2 / scale, bottom = this.frame.y - height / 2 / scale;
    pen.fillStyle = colours.floor;
    pen.fillRect(0, 0, width, height);
    pen.strokeStyle = colours.line;
    pen.lineWidth = 1;
    pen.beginPath();
    for (let x = Math.ceil(left / 0.5) * 0.5; X(x) < width; x += 0.5) { pen.moveTo(X(x), 0); pen.lineTo(X(x), height); }
    for (let y = Math.ceil(bottom / 0.5) * 0.5; Y(y) > 0; y += 0.5) { pen.moveTo(0, Y(y)); pen.lineTo(width, Y(y)); }
    pen.stroke();
    pen.fillStyle = colours.rose;
    pen.globalAlpha = 0.7;
    for (const { listener, speaker, share } of this.links(t)) {
      const a = poses[speaker], b = poses[listener], far = Math.hypot(b.x - a.x, b.y - a.y) || 1, wide = (1 + 9 * share) / 2;
      const [sx, sy] = [(b.y - a.y) / far * wide, (b.x - a.x) / far * wide];
      pen.beginPath();
      pen.moveTo(X(a.x) + sx, Y(a.y) + sy);
      pen.lineTo(X(a.x) - sx, Y(a.y) - sy);
      pen.lineTo(X(b.x), Y(b.y));
      pen.fill();
    }
    pen.globalAlpha = 1;
    poses.forEach(({ x, y, heading }, i) => {
      const broken = i === lame, size = Math.max(4, radius * scale);
      pen.fillStyle = broken ? colours.right : i < data.knowers ? colours.left : colours.soft;
      disc(pen, X(x), Y(y), size);
      pen.fill();
      pen.strokeStyle = colours.ink;
      pen.lineWidth = 2;
      pen.beginPath();
      pen.moveTo(X(x), Y(y));
      pen.lineTo(X(x) + 1.5 * size * Math.cos(heading), Y(y) - 1.5 * size * Math.sin(heading));
      pen.stroke();
      if (i === this.selected) {
        pen.setLineDash([3, 3]);
        disc(pen, X(x), Y(y), size + 5);
        pen.stroke();
        pen.setLineDash([]);
      }
    });
    pen.fillStyle = colours.soft;
    pen.textAlign = "right";
    pen.fillText("to the goal →", width - 6, height - 6);
    const cosine = this.cosineAt(t);
    const lost = lame < 0 ? 0 : Math.hypot(poses[lame].x - x0, poses[lame].y - y0);
    this.now.textContent = `heading to the goal: ${cosine.toFixed(2).replace("-", "−")}` +
      (lame < 0 ? "" : `; the broken robot is ${lost.toFixed(1)} m away`);
    this.canvas.ariaLabel = `${this.name}: ${robots} robots, ${this.now.textContent}`;
  }
}
