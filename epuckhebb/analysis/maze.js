/** A number with its sign; 0 has none. */
function signed(value, digits) {
  const text = Math.abs(value).toFixed(digits);
  return Number(text) === 0 ? text : (value > 0 ? "+" : "−") + text;
}

/** A short number: 0.712, 6.84, 374, 1.1×10⁻⁵. */
function brief(value) {
  if (value === 0) return "0";
  const power = Math.floor(Math.log10(Math.abs(value)));
  if (power >= -2) return value.toFixed(Math.max(0, 2 - Math.max(0, power))).replace("-", "−");
  return `${(value / 10 ** power).toFixed(1)}×10${[...String(power)].map((digit) => "⁰¹²³⁴⁵⁶⁷⁸⁹"[digit] ?? "⁻").join("")}`;
}

/** Two canvases, one over the other: the lower one changes seldom, the upper one moves. */
function stack() {
  const below = element("canvas", { ariaHidden: "true" }), above = element("canvas", { role: "img" });
  return { below, above, both: element("div", { className: "stack" }, below, above) };
}

function disc(pen, x, y, radius) {
  pen.beginPath();
  pen.arc(x, y, radius, 0, 2 * Math.PI);
}

const controllerColour = (c) =>
  [colours.soft, colours.side, colours.near, colours.rose, colours.fell, colours.lamp][(c + (data.controllers.length === 1)) % 6];

/** A robot in its maze. */
class Maze {
  constructor(c) {
    this.c = c;
    this.canvases = stack();
    this.now = element("p", { className: "now" });
    this.figure = element("figure", {},
      element("figcaption", {}, element("h3", { textContent: data.controllers[c] })),
      this.canvases.both, this.now);
    $("mazes").append(this.figure);
  }

  /** Most pixels of its height. */
  tallest() {
    return 620;
  }

  resize() {
    const [left, right, bottom, top] = maze.view, height = (width) => Math.min(this.tallest(), width * (top - bottom) / (right - left));
    this.still = fit(this.canvases.below, height);
    this.pen = fit(this.canvases.above, height);
    const width = this.canvases.below.clientWidth;
    this.scale = Math.min(width / (right - left), height(width) / (top - bottom));
    this.margin = (width - this.scale * (right - left)) / 2;
    this.drawStill();
  }

  at(x, y) {
    return [this.margin + (x - maze.view[0]) * this.scale, (maze.view[3] - y) * this.scale];
  }

  /** Boxes as one path, so that no seam shows between neighbours. */
  boxes(pen, boxes, fill) {
    pen.fillStyle = fill;
    pen.beginPath();
    for (const [left, right, bottom, top] of boxes) {
      pen.rect(...this.at(left, top), (right - left) * this.scale, (top - bottom) * this.scale);
    }
    pen.fill();
  }

  drawStill() {
    this.worldDrawn = worldNumber(lifetimes[shown.side][this.c], shown.t);
    const pen = this.still, { obstacles, goals, light, lamp, lit: byHand } = data.worlds[this.worldDrawn];
    const lit = byHand ?? (shown.side === "right" && !data.hasTrials);
    pen.clearRect(0, 0, this.canvases.below.width, this.canvases.below.height);
    pen.fillStyle = colours.floor;
    pen.fillRect(this.margin, 0, this.canvases.below.clientWidth - 2 * this.margin, this.canvases.below.height);
    if (sunChanges) {
      pen.fillStyle = colours.lamp;
      pen.globalAlpha = 0.2 * Math.min(1, light);
      pen.fillRect(this.margin, 0, this.canvases.below.clientWidth - 2 * this.margin, this.canvases.below.height);
      pen.globalAlpha = 1;
    }
    const [x, y] = this.at(lamp.x, lamp.y);
    if (lit && lamp.intensity) {
      const far = 0.28 * Math.sqrt(lamp.intensity) * this.scale;  // about the reach of this brightness
      pen.save();
      const glow = pen.createRadialGradient(x, y, 0, x, y, far);
      glow.addColorStop(0, colours.lamp);
      glow.addColorStop(1, colours.lamp.replace("rgb(", "rgba(").replace(")", ", 0)"));
      pen.fillStyle = glow;
      pen.globalAlpha = 0.55;
      pen.beginPath();
      pen.moveTo(x, y);
      pen.arc(x, y, far, -lamp.towards - lamp.beam, -lamp.towards + lamp.beam);
      pen.fill();
      pen.restore();
    }
    this.boxes(pen, obstacles, colours.obstacle);
    this.boxes(pen, maze.walls, colours.wall);

    for (const goal of data.hasTrials ? Object.values(goals) : [goals[shown.side]]) {
      const [goalX, goalY] = this.at(...goal);
      disc(pen, goalX, goalY, maze.goalRadius * this.scale);
      pen.fillStyle = pen.strokeStyle = colours.side;
      pen.globalAlpha = 0.14;
      pen.fill();
      pen.globalAlpha = 1;
      pen.lineWidth = 1.5;
      pen.setLineDash([4, 3]);
      pen.stroke();
      pen.setLineDash([]);
      disc(pen, goalX, goalY, 2);
      pen.fill();
    }

    disc(pen, x, y, 6);
    pen.fillStyle = lit ? colours.lamp : colours.wall;
    pen.strokeStyle = lit ? colours.lamp : colours.floor;
    pen.fill();
    pen.stroke();
    pen.fillStyle = colours.ink;
    pen.textBaseline = "middle";
    const beside = Math.cos(lamp.towards) > 0.1 || x > 0.85 * this.canvases.below.clientWidth ? -11 : 11;
    pen.textAlign = beside > 0 ? "left" : "right";
    pen.fillText("lamp", x + beside, y - 7);
    pen.fillText(lit ? "on" : "off", x + beside, y + 7);
    const [startX, startY] = this.at(...maze.start);
    pen.fillStyle = colours.soft;
    disc(pen, startX, startY, 3);
    pen.fill();
    this.drawnTo = 0;
    this.canvases.above.setAttribute("aria-label", `${data.controllers[this.c]}: the maze from above, ${lit ? "lamp on" : "lamp off"}, ${data.hasTrials ? `${shown.side} end rewarded first` : `goal on the ${shown.side}`}`);
  }

  /** Draw the trail from the last drawn sample up to sample k. */
  trail(k) {
    if (k < this.drawnTo) this.drawStill();
    if (k === this.drawnTo) return;
    const line = (life, style, width) => {
      this.still.strokeStyle = style;
      this.still.lineWidth = width;
      this.still.lineJoin = this.still.lineCap = "round";
      this.still.beginPath();
      for (let i = this.drawnTo; i <= k; i++) {
        this.still[life.resets.includes(i) ? "moveTo" : "lineTo"](...this.at(life.x[sampleAt(i)], life.y[sampleAt(i)]));
      }
      this.still.stroke();
    };
    if (this.c > 0) line(lifetimes[shown.side][0], colours.soft, 1);
    line(lifetimes[shown.side][this.c], colours.side, 2);
    this.drawnTo = k;
  }

  draw() {
    const life = lifetimes[shown.side][this.c], { k, x, y, heading } = poseAt(life, shown.t), pen = this.pen;
    if (worldNumber(life, shown.t) !== this.worldDrawn) this.drawStill();
    this.trail(k);
    pen.clearRect(0, 0, this.canvases.above.width, this.canvases.above.height);
    if (this.c > 0) this.drawGhost(poseAt(lifetimes[shown.side][0], shown.t));
    this.drawRobot(life, k, x, y, heading);
    this.now.textContent = situation(life, shown.t);
  }

  drawGhost({ x, y }) {
    disc(this.pen, ...this.at(x, y), robot.radius * this.scale);
    this.pen.strokeStyle = colours.soft;
    this.pen.lineWidth = 1.5;
    this.pen.stroke();
  }

  drawRobot(life, k, x, y, heading) {
    const pen = this.pen, radius = robot.radius * this.scale, [cx, cy] = this.at(x, y);
    const cos = Math.cos(heading), sin = Math.sin(heading);
    pen.lineCap = "butt";
    disc(pen, cx, cy, radius);
    pen.fillStyle = pen.strokeStyle = colours.side;
    pen.globalAlpha = 0.3;
    pen.fill();
    pen.globalAlpha = 1;
    pen.lineWidth = 1.5;
    pen.stroke();
    pen.beginPath();  // an arrowhead in its direction
    for (const [along, angle] of [[0.62, 0], [0.45, 2.45], [0.2, Math.PI], [0.45, -2.45]]) {
      pen.lineTo(cx + along * radius * Math.cos(heading + angle), cy - along * radius * Math.sin(heading + angle));
    }
    pen.fill();
    const world = worldAt(life, shown.t), thin = Math.min(1, Math.sqrt(8 / DISTANCES)), blind = [];
    const onRobot = ([ahead, aside]) => [x + cos * ahead - sin * aside, y + sin * ahead + cos * aside];
    robot.distances.forEach((place, i) => {
      const [ahead, aside, azimuth] = place, [fromX, fromY] = onRobot(place);
      const lookX = Math.cos(heading + azimuth), lookY = Math.sin(heading + azimuth);
      const near = life.sensors[sampleAt(k) * INPUTS + LIGHTS + i], length = rayLength(world, fromX, fromY, lookX, lookY);
      if (world.dead.includes(i)) blind.push(this.at(fromX, fromY));
      else {
        pen.strokeStyle = near > 0.05 ? colours.near : colours.soft;
        pen.globalAlpha = 0.35 + 0.65 * Math.sqrt(near);
        pen.lineWidth = thin * (1 + 4 * near);
        pen.beginPath();
        pen.moveTo(...this.at(fromX, fromY));
        pen.lineTo(...this.at(fromX + length * lookX, fromY + length * lookY));
        pen.stroke();
        pen.globalAlpha = 1;
      }
      if (near > robot.contact) {
        pen.strokeStyle = colours.ink;
        pen.lineWidth = 4;
        pen.beginPath();
        const towards = -heading - Math.atan2(aside, ahead), wide = Math.min(0.3, 2.8 / DISTANCES);
        pen.arc(cx, cy, radius + 1, towards - wide, towards + wide);
        pen.stroke();
      }
    });
    const size = Math.min(Math.max(2, 0.11 * radius), Math.max(1.2, 2.2 * radius / LIGHTS));
    robot.lights.forEach((place, i) => {
      const [px, py] = this.at(...onRobot(place));
      disc(pen, px, py, size);
      pen.fillStyle = colours.floor;
      pen.fill();
      pen.fillStyle = pen.strokeStyle = colours.lamp;
      pen.globalAlpha = 1 - life.sensors[sampleAt(k) * INPUTS + i];
      pen.fill();
      pen.globalAlpha = 1;
      pen.lineWidth = 1;
      pen.stroke();
      if (world.dead.includes(i)) blind.push([px, py]);
    });
    pen.strokeStyle = colours.ink;
    pen.lineWidth = 2;
    for (const [px, py] of blind) {
      pen.beginPath();
      for (const across of [-4, 4]) {
        pen.moveTo(px - across, py - 4);
        pen.lineTo(px + across, py + 4);
      }
      pen.stroke();
    }
  }
}

/** Length of a ray from (x, y) [m] to a wall, at most the reach of the sensor. */
function rayLength(world, x, y, lookX, lookY) {
  let length = robot.reach;
  for (const [left, right, bottom, top] of [...maze.walls, ...world.obstacles]) {
    const [toLeft, toRight, toBottom, toTop] = [(left - x) / lookX, (right - x) / lookX, (bottom - y) / lookY, (top - y) / lookY];
    const enter = Math.max(Math.min(toLeft, toRight), Math.min(toBottom, toTop));
    const leave = Math.min(Math.max(toLeft, toRight), Math.max(toBottom, toTop));
    if (leave >= Math.max(0, enter)) length = Math.min(length, Math.max(0, enter));
  }
  return length;
}

/** The position of a robot in words. */
function situation(life, t) {
  const { k, x, y } = poseAt(life, t), number = worldNumber(life, t), world = data.worlds[number];
  const goals = data.hasTrials ? Object.values(world.goals) : [world.goals[shown.side]];
  const distance = Math.min(...goals.map(([goalX, goalY]) => Math.hypot(x - goalX, y - goalY)));
  const readings = life.sensors.subarray(sampleAt(k) * INPUTS, (sampleAt(k) + 1) * INPUTS);
  const touching = readings.subarray(LIGHTS, LIGHTS + DISTANCES).some((near) => near > robot.contact);
  const since = life.stayed && t >= life.arrival ? `, arrived after ${life.arrival.toFixed(1)} s` : "";
  const goal = data.hasTrials ? "an end" : "the goal";
  const where = distance < maze.goalRadius ? `at ${goal}${since}` : `${(100 * distance).toFixed(0)} cm from ${goal}`;
  const around = sunChanges ? [`light ${world.light}`] : [];
  if (data.hasTrials) {
    const reward = Math.round(readings[INPUTS - 1]), times = life.resets.filter((sample) => sample <= k).length;
    around.push(`reset to the start ${times} times`, ...(reward ? [`reward ${reward}`] : []));
  }
  if (world.faults) around.push(world.faults);
  // New walls wait until the robot has left their place, and later changes wait for them.
  if (!data.isLive && data.changes.filter(({ at }) => at + 0.05 < t).length > number) around.push(`change ${number + 1} waits until the robot has moved away`);
  return [where + (touching ? ", touching a wall" : ""), ...around].join("; ");
}
