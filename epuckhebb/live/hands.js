// ---- What is changed by hand ----

const RATES = [0, 0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000];
const WINDOW = 120;  // s that charts show
const TRAIL = 1900;  // steps of a trail that stay when the world changes
let now = data, world = data.world, following = true, views = [], wanted = 0, last = 0, chartsDrawn = 0;
const SETTLES = 200;  // ms until what was wished is seen
let selected = null, hand = null, waiting = null, isBusy = false, previews = false, wished = { since: -Infinity };
const costs = [];  // ms of each picture, for tests
const inSight = new Set();

function redraw() {
  wanted ||= requestAnimationFrame(picture);
}

function link() {}

/** Go to a moment [s] of those that are kept; the last one is now. */
function seek(t) {
  following = t >= END;
  shown.t = Math.max(START, Math.min(END, t));
  $("now").hidden = following;
  redraw();
}

/** Ask for a change; while one is on its way, newer values replace older ones. */
async function change(values) {
  waiting = { ...waiting, ...values, ...(values.lamp && { lamp: { ...waiting?.lamp, ...values.lamp } }) };
  dismiss();
  if (isBusy) return;
  isBusy = true;
  while (waiting) {
    const wish = { do: "change", values: waiting };
    waiting = null;
    const { error } = await ask(wish);
    if (error) follow({ ...now });  // as it is, not as it was wished
  }
  isBusy = false;
}

function dismiss() {
  $("hint").hidden = true;
  try { sessionStorage.setItem("understood", "yes"); } catch { /* a frame may not keep anything */ }
}

const things = () => ["robot", "lamp", ...world.placed.map((_, i) => i)];
const nameOf = (thing) => (typeof thing === "number" ? `block ${thing + 1}` : thing);
const robotNow = () => poseAt(own.at(-1), END);
const isFloor = (x, y) => !maze.walls.some(([left, right, bottom, top]) => x > left && x < right && y > bottom && y < top);

function placeOf(thing) {
  if (thing === "robot") {
    if (hand?.thing === "robot") return hand;
    if (performance.now() - wished.since < SETTLES) return wished;
    return now.put ? { x: now.put[0], y: now.put[1], heading: now.put[2] } : robotNow();
  }
  if (thing === "lamp") return world.lamp;
  return { x: world.placed[thing][0], y: world.placed[thing][1] };
}

/** Whether a robot has room at a place. */
function fits(x, y) {
  return isFloor(x, y) && [...maze.walls, ...world.obstacles].every(([left, right, bottom, top]) =>
    Math.hypot(Math.max(left - x, x - right, 0), Math.max(bottom - y, y - top, 0)) >= robot.radius);
}

/** Move a thing, as far as it can be there. */
function move(thing, x, y, heading) {
  const inArena = (value) => Math.max(-data.arena, Math.min(data.arena, value));
  [x, y] = [inArena(x), inArena(y)];
  if (thing === "robot") {
    if (!fits(x, y)) return;
    wished = { x, y, heading, since: performance.now() };
    if (hand) Object.assign(hand, wished);
    change({ put: [x, y, heading] });
  } else if (thing === "lamp") change({ lamp: { x_m: x, y_m: y } });
  else if (isFloor(x, y)) place(world.placed.map((box, i) => (i === thing ? [x, y, box[2], box[3]] : box)));
  redraw();
}

function place(placed) {
  world.placed = placed;
  change({ placed });
}

function select(thing) {
  selected = thing;
  $("drop").disabled = typeof thing !== "number";
  $("said").textContent = thing === null ? "nothing chosen" : `${nameOf(thing)} chosen`;
  redraw();
}

/** Put a block where the robot is going, or beside it where there is floor. */
function add() {
  if (world.placed.length >= data.mostBlocks) { $("trouble").textContent = `${data.mostBlocks} blocks are as many as there can be`; return; }
  const { x, y, heading } = placeOf("robot"), away = 2.4 * robot.radius;
  const ways = [0, 0.8, -0.8, 1.6, -1.6, 2.4, -2.4, Math.PI].map((turn) => [x + away * Math.cos(heading + turn), y + away * Math.sin(heading + turn)]);
  const [bx, by] = ways.find((way) => isFloor(...way)) ?? ways[0];
  place([...world.placed, [bx, by, 0.03, 0.03]]);
  select(world.placed.length - 1);
}

function drop() {
  if (typeof selected !== "number") return;
  place(world.placed.filter((_, i) => i !== selected));
  select(null);
}

/** A maze in which things can be moved. */
class LiveMaze extends Maze {
  constructor(c) {
    super(c);
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
      hand = { thing: near, dx: at.x - x, dy: at.y - y, x: at.x, y: at.y, heading: at.heading };
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!hand) return;
      const [x, y] = here(event);
      move(hand.thing, x + hand.dx, y + hand.dy, hand.heading);
    });
    const release = () => { hand = null; redraw(); };
    canvas.addEventListener("pointerup", release);
    canvas.addEventListener("pointercancel", release);
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

  drawStill() {
    super.drawStill();
    this.drawnTo = Math.max(oldest, poseAt(own[this.c], shown.t).k - TRAIL);
  }

  draw() {
    const life = own[this.c], pen = this.pen, isHeld = following && (hand?.thing === "robot" || now.put);
    if (worldNumber(life, shown.t) !== this.worldDrawn) this.drawStill();
    const pose = poseAt(life, shown.t), { x, y, heading } = isHeld ? placeOf("robot") : pose;
    this.drawnTo = Math.max(this.drawnTo, oldest);
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
  }
}

/** A chart of the last two minutes, or of those around the moment that is shown. */
class LiveChart extends Chart {
  range() {
    const until = following ? END : Math.min(END, Math.max(shown.t + WINDOW / 2, START + WINDOW));
    return [Math.max(START, until - WINDOW), Math.max(until, START + 1)];
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
  shown.t = Math.max(shown.t, START);  // what was looked at is not kept any more
  if (at - chartsDrawn > 300 || !runs) {
    chartsDrawn = at;
    for (const view of views) if (view instanceof Chart && inSight.has(view.figure)) view.resize();
  }
  for (const view of views) if (inSight.has(view.figure)) view.draw(at);
  [$("time").min, $("time").max] = [START, END];
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

/** Take the news of the world. */
function follow(news) {
  if (news.life !== undefined && news.life !== data.life) { location.reload(); return; }
  const moved = now.byHand !== news.byHand, isNew = JSON.stringify(news.world) !== JSON.stringify(now.world);
  now = structuredClone(news);
  if (isNew && (!previews || !news.pending)) {
    if (previews) { data.worlds.pop(); own.forEach(({ begins }) => begins.pop()); }
    data.worlds.push(now.world);
    for (const { begins } of own) begins.push(news.pending ? END : news.last.at ?? END);
  } else if (isNew) data.worlds[data.worlds.length - 1] = now.world;
  else if (previews && !news.pending) for (const { begins } of own) begins[begins.length - 1] = news.last.at ?? END;
  previews = news.pending && (isNew || previews);
  const keys = news.last.keys.join(", ").replaceAll("_", " "), before = data.changes.at(-1);
  const goesOn = before?.keys === keys && before.at > news.last.at - 0.3;  // a drag is many changes, and one mark
  if (moved && news.last.at !== null && !goesOn) {
    data.changes.push({ at: news.last.at, byHand: true, keys });
    log(`${news.last.at.toFixed(1)} s: ${keys}`);
  }
  const placed = waiting?.placed ?? (typeof hand?.thing === "number" ? world.placed : now.world.placed);
  world = { ...structuredClone(now.world), placed };
  if (typeof selected === "number" && selected >= world.placed.length) select(null);
  shown.playing = now.playing;
  shown.speed = now.speed;
  if (isNew) for (const view of views) if (view instanceof Maze) view.drawStill();
  controls();
  redraw();
}

function log(line) {
  $("log").prepend(element("span", { textContent: line }), element("br"));
  while ($("log").childNodes.length > 60) $("log").lastChild.remove();
}

function controls() {
  const show = (id, value, text) => {
    const input = $(id);
    if (!input.matches(":active")) input.value = value;
    input.previousElementSibling.textContent = text;
    input.setAttribute("aria-valuetext", text);
  };
  const nearest = RATES.reduce((best, rate, i) => (Math.abs(rate - world.rate) < Math.abs(RATES[best] - world.rate) ? i : best), 0);
  show("light", world.light, world.light.toFixed(2));
  show("intensity", world.lamp.intensity, world.lamp.intensity.toFixed(2));
  show("rate", nearest, `${world.rate} × ${brief(data.N)}`);
  show("left_wheel", world.left, `${Math.round(100 * world.left)} %`);
  show("right_wheel", world.right, `${Math.round(100 * world.right)} %`);
  $("lit").setAttribute("aria-pressed", world.lit);
  $("sensors").querySelectorAll("button").forEach((button, i) => button.setAttribute("aria-pressed", world.dead.includes(i)));
  $("play").textContent = shown.playing ? "Pause" : "Play";
  $("speed").value = shown.speed;
  $("new").disabled = Boolean(now.prepares);
  const goal = data.hasTrials ? "Either end may be the rewarded one." : shown.side === "right" ? "Evolved to turn right, since the lamp is on." : "Evolved to turn left, since the lamp is off.";
  $("outcome").textContent = now.trouble ? `The world has stopped: ${now.trouble}` : now.prepares ? `Preparing ${now.prepares} …`
    : now.over ? "This life has ended. Save it, or begin a new one." : `${goal} Disturb it.`;
}
