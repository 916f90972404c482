const GUTTER = 64;  // pixels left of a plot, for its scale; the cursor of drawing.css begins there
const MOST_POINTS = 1000;  // of a curve

/** A quantity of all controllers over time. */
class Chart {
  constructor({ name, heading, note, unit = "", low, high, factor = 1 }) {
    const [least, most] = ends(name);
    Object.assign(this, { name, unit, factor, low: low ?? least * factor, high: high ?? (most * factor || (least < 0 ? 0 : 1)) });
    this.canvas = element("canvas");
    this.canvas.setAttribute("role", "img");
    this.canvas.setAttribute("aria-label", `${heading} over time`);
    this.cursor = element("i", { className: "cursor" });
    this.now = element("p", { className: "now" });
    this.plot = element("div", { className: "plot" }, this.canvas, this.cursor);
    this.figure = element("div", { className: "chart" },
      element("div", {}, element("h3", { textContent: heading }), element("p", { className: "soft", textContent: note }), this.now),
      this.plot);
    $("charts").append(this.figure);
    this.values = data.controllers.map(() => {
      const key = element("span", { className: "key" }), value = document.createTextNode("");
      this.now.append(element("span", { className: "value" }, key, value));
      return { key, value };
    });
    const seekHere = (event) => seek(this.drawn[0] + (event.offsetX - GUTTER) / (this.canvas.clientWidth - GUTTER) * (this.drawn[1] - this.drawn[0]));
    this.plot.addEventListener("pointerdown", (event) => {
      this.plot.setPointerCapture(event.pointerId);
      seekHere(event);
    });
    this.plot.addEventListener("pointermove", (event) => event.buttons && seekHere(event));
    this.plot.addEventListener("pointerup", link);
  }

  /** The times between which it is drawn [s]. */
  range() {
    return [0, END];
  }

  resize() {
    const pen = fit(this.canvas, () => 96), width = this.canvas.clientWidth, top = 8, bottom = 78;
    const [from, until] = this.drawn = this.range(), lasts = until - from;
    const xOf = (t) => GUTTER + (t - from) / (lasts || 1) * (width - GUTTER - 1);
    const yOf = (value) => bottom - (value - this.low) / (this.high - this.low) * (bottom - top);
    pen.strokeStyle = colours.line;
    pen.fillStyle = colours.soft;
    pen.lineWidth = 1;
    const every = [1, 2, 5, 10, 20, 50, 100, 200, 500, 1000].find((step) => (width - GUTTER) * step / (lasts || 1) > 64) ?? 5000;
    pen.textAlign = "center";
    for (let t = Math.ceil(from / every) * every; t <= until; t += every) {
      pen.strokeRect(Math.round(xOf(t)) + 0.5, top, 0, bottom - top);
      pen.textAlign = t + every > until && until - t < every / 4 ? "right" : "center";
      pen.fillText(t ? `${t} s` : "0", xOf(t), 92);
    }
    pen.textAlign = "right";
    pen.textBaseline = "middle";
    for (const value of new Set([this.low, 0, this.high])) {
      pen.strokeRect(GUTTER, Math.round(yOf(value)) + 0.5, width - GUTTER, 0);
      if (value === 0 || Math.abs(yOf(value) - yOf(0)) > 10) pen.fillText(Number.isInteger(value) ? String(value).replace("-", "−") : brief(value), GUTTER - 7, yOf(value));
    }
    pen.textAlign = "center";
    data.changes.forEach(({ at, byHand }, i) => {
      if (at > until || at < from) return;
      if (byHand) {
        pen.strokeStyle = colours.near;
        pen.strokeRect(xOf(at), bottom - 7, 0, 7);
        return;
      }
      pen.setLineDash([1, 3]);
      pen.strokeStyle = colours.ink;
      pen.strokeRect(xOf(at), top, 0, bottom - top);
      pen.setLineDash([]);
      pen.fillText(`◆${i + 1}`, xOf(at), 7);
    });
    lifetimes[shown.side].forEach((life, c) => {
      pen.strokeStyle = controllerColour(c);
      pen.lineWidth = 1.4;
      pen.beginPath();
      const first = Math.floor(from / data.interval), last = Math.min(samples, until / data.interval + 1);
      const stride = Math.ceil((last - first) / MOST_POINTS);
      for (let k = first; k < last; k += stride) pen.lineTo(xOf(k * data.interval), yOf(life[this.name][sampleAt(k)] * this.factor));
      pen.stroke();
      if (life.arrival !== null && life.arrival >= from) {
        pen.lineWidth = 2;
        pen.setLineDash([3, 3]);
        pen.beginPath();
        pen.moveTo(xOf(life.arrival), top);
        pen.lineTo(xOf(life.arrival), bottom);
        pen.stroke();
        pen.setLineDash([]);
      }
    });
    this.width = width;
  }

  draw() {
    const [from, until] = this.drawn, part = Math.max(0, Math.min(1, (shown.t - from) / (until - from || 1)));
    this.cursor.style.transform = `translateX(${part * (this.width - GUTTER - 1)}px)`;
    lifetimes[shown.side].forEach((life, c) => {
      const text = ` ${brief(life[this.name][sampleAt(poseAt(life, shown.t).k)] * this.factor)}${this.unit}`;
      if (this.values[c].value.data !== text) this.values[c].value.data = text;
    });
  }
}
