// ---- What is drawn ----

/** A maze in which things can be moved. */
class LiveMaze extends Maze {
  constructor(c) {
    super(c);
    this.flag = element("p", { className: "flag" });
    this.figure.firstChild.append(this.flag);
    const canvas = this.canvases.above;
    canvas.tabIndex = 0;
    canvas.setAttribute("role", "application");
    canvas.setAttribute("aria-describedby", "keys");
    const here = (event) => {
      const box = canvas.getBoundingClientRect();
      return [(event.clientX - box.left - this.margin) / this.scale + maze.view[0], maze.view[3] - (event.clientY - box.top) / this.scale];
    };
    canvas.addEventListener("pointerdown", (event) => {
      const [x, y] = here(event), reach = Math.max(0.015, 16 / this.scale);
      const far = (thing) => Math.hypot(placeOf(thing).x - x, placeOf(thing).y - y) - (thing === "robot" ? robot.radius : 0);
      const near = things().filter((thing) => far(thing) < (thing === "robot" ? reach / 2 : reach)).sort((a, b) => far(a) - far(b))[0] ?? null;
      select(near);
      if (near === null) return;
      canvas.setPointerCapture(event.pointerId);
      const at = placeOf(near);
      drag(true);
      hand = { thing: near, dx: at.x - x, dy: at.y - y, x: at.x, y: at.y, heading: at.heading };
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!hand) return;
      const [x, y] = here(event);
      move(hand.thing, x + hand.dx, y + hand.dy, hand.heading);
    });
    canvas.addEventListener("keydown", (event) => {
      const key = event.key.length === 1 ? event.key.toLowerCase() : event.key;
      const way = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] }[key], turn = { q: 0.26, e: -0.26 }[key];
      if (key === "t") select(things()[(things().indexOf(selected) + 1) % things().length]);
      else if ((way || (turn && selected === "robot")) && selected !== null) {
        const at = placeOf(selected), by = event.shiftKey ? 0.001 : 0.01;
        move(selected, at.x + by * (way?.[0] ?? 0), at.y + by * (way?.[1] ?? 0), at.heading + (turn ?? 0));
      } else return;
      event.preventDefault();
      event.stopPropagation();
    });
  }

  /** Leaves room for the network, and for the time line. */
  tallest() {
    return Math.max(230, innerHeight - 540);
  }

  drawStill() {
    super.drawStill();
    this.drawnTo = Math.max(0, poseAt(own[this.c], shown.t).k - TRAIL);
  }

  draw() {
    const life = own[this.c], pen = this.pen, isHeld = following && (hand?.thing === "robot" || now.put);
    if (worldNumber(life, shown.t) !== this.worldDrawn) this.drawStill();
    const pose = poseAt(life, shown.t), { x, y, heading } = isHeld ? placeOf("robot") : pose;
    this.trail(pose.k);
    pen.clearRect(0, 0, this.canvases.above.width, this.canvases.above.height);
    if (this.c > 0 && !isHeld) this.drawGhost(poseAt(own[0], shown.t));
    this.drawRobot(life, pose.k, x, y, heading);
    if (selected !== null && (typeof selected !== "number" || world.placed[selected])) {
      const at = selected === "robot" ? { x, y } : placeOf(selected);
      disc(pen, ...this.at(at.x, at.y), selected === "robot" ? robot.radius * this.scale + 4 : 14);
      pen.setLineDash([3, 3]);
      pen.strokeStyle = colours.ink;
      pen.lineWidth = 1.5;
      pen.stroke();
      pen.setLineDash([]);
    }
    this.now.textContent = situation(life, shown.t);
    const [sign, word, kind] = flag(life, this.c, shown.t), text = `${sign} ${word}`.trim();
    if (this.flag.textContent !== text) [this.flag.textContent, this.flag.dataset.kind] = [text, kind];
    if (kind === "there" || kind === "won") this.drawFlag();
  }

  /** A flag on the goal, while the robot is there. */
  drawFlag() {
    const [x, base] = this.at(...goalNow()), y = Math.max(32, base), pen = this.pen;
    pen.strokeStyle = pen.fillStyle = colours.ink;
    pen.lineWidth = 2;
    pen.beginPath();
    pen.moveTo(x, base);
    pen.lineTo(x, y - 30);
    pen.stroke();
    pen.fillStyle = colours.won;
    pen.beginPath();
    pen.moveTo(x, y - 30);
    pen.lineTo(x + 20, y - 23);
    pen.lineTo(x, y - 16);
    pen.fill();
  }
}

/** A network below its maze, as high as there is room. */
class LiveNetwork extends Network {
  constructor(c) {
    super(c);
    views[c].figure.append(this.figure);
  }

  height() {
    return 176;
  }
}

/** A chart of the last two minutes, or of those around the moment that is shown. */
class LiveChart extends Chart {
  range() {
    const until = following ? END : Math.min(END, Math.max(shown.t + WINDOW / 2, WINDOW));
    return [Math.max(0, until - WINDOW), Math.max(until, 1)];
  }

  resize() {
    const [least, most] = ends(this.name);
    [this.low, this.high] = [least * this.factor, this.name === "fitness" ? 1 : most * this.factor || 1];
    super.resize();
  }
}

// ---- How it runs ----

function picture(at) {
  wanted = 0;
  const began = performance.now();
  const passed = Math.max(0, Math.min(100, at - last)) / 1000, runs = shown.playing && !now.over;
  last = at;
  if (following) {
    const lag = 2 * data.interval * Math.max(1, shown.speed);  // so that the picture does not wait for the next numbers
    shown.t = runs && !hand && shown.speed ? Math.min(END, Math.max(shown.t + passed * shown.speed, END - lag)) : END;
  }
  if (at - chartsDrawn > 300 || !runs) {
    chartsDrawn = at;
    for (const view of views) if (view instanceof Chart && inSight.has(view.figure)) view.resize();
  }
  for (const view of views) if (inSight.has(view.figure)) view.draw(at);
  $("time").max = END;
  $("time").value = shown.t;
  $("clock").firstChild.textContent = `${shown.t.toFixed(1)} s`;
  $("clock").lastChild.textContent = ` · ${now.byHand} by hand`;
  costs.push(performance.now() - began);
  if (costs.length > 300) costs.shift();
  if (runs || hand) redraw();
}

function repaint() {
  readColours();
  for (const view of views) view.resize();
  document.querySelectorAll(".key").forEach((key, i) => { key.style.borderColor = controllerColour(i % data.controllers.length); });
  redraw();
}
