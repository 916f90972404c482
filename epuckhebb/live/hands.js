// ---- What is changed by hand ----

const RATES = [0, 0.1, 0.3, 1, 3, 10, 30, 100, 300, 1000];
const WINDOW = 120;  // s that charts show
const TRAIL = 1900;  // steps of a trail that stay when the world changes
let now = data, world = data.world, following = true, views = [], wanted = 0, last = 0, chartsDrawn = 0;
const SETTLES = 200;  // ms until what was wished is seen
let selected = null, hand = null, speedBefore = null, waiting = null, isBusy = false, previews = false, wished = { since: -Infinity };
const costs = [];  // ms of each picture, for tests
const inSight = new Set();

function redraw() {
  wanted ||= requestAnimationFrame(picture);
}

function link() {}

/** Go to a moment [s] of this life; the last one is now. */
function seek(t) {
  following = t >= END;
  shown.t = Math.max(0, Math.min(END, t));
  $("now").hidden = following;
  redraw();
}

const joined = (before, values) => ({ ...before, ...values, ...(values.lamp && { lamp: { ...before?.lamp, ...values.lamp } }) });

/** Keep a wish for the life that is being prepared: this one ends with it. */
function keep(values) {
  remember("kept", joined(recall("kept", {}), values));
  complain("it comes with the new life");
}

/** Ask for a change; while one is on its way, newer values replace older ones. */
async function change(values) {
  if (now.prepares) { keep(values); return; }
  waiting = joined(waiting, values);
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

/** Run in real time while something is dragged, and then as before. */
function drag(isDragged) {
  if (isDragged && speedBefore === null) {
    speedBefore = shown.speed;
    setSpeed(1);
  } else if (!isDragged && speedBefore !== null) {
    setSpeed(speedBefore);
    speedBefore = null;
  }
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

const BLOCK = 0.03;  // m a side

/** Whether a block fits at a place, and no wall is between it and a robot. */
function isInSight(x, y, from) {
  const corners = [[-1, -1], [-1, 1], [1, -1], [1, 1]].map(([i, j]) => [x + i * BLOCK / 2, y + j * BLOCK / 2]);
  const way = [0.2, 0.4, 0.6, 0.8].map((part) => [from.x + part * (x - from.x), from.y + part * (y - from.y)]);
  return [...corners, ...way].every((at) => isFloor(...at));
}

/** Put a block where the robot is going, or beside it where there is room. */
function add() {
  if (now.prepares) { keep({ blocks: (recall("kept", {}).blocks ?? 0) + 1 }); return; }
  if (world.placed.length >= data.mostBlocks) { complain(`${data.mostBlocks} blocks are as many as there can be`); return; }
  const from = placeOf("robot"), away = 2.4 * robot.radius;
  const ways = [0, 0.8, -0.8, 1.6, -1.6, 2.4, -2.4, Math.PI].map((turn) => [from.x + away * Math.cos(from.heading + turn), from.y + away * Math.sin(from.heading + turn)]);
  const found = ways.find(([x, y]) => isInSight(x, y, from));
  if (!found) { complain("there is no room for a block beside the robot"); return; }
  place([...world.placed, [...found, BLOCK, BLOCK]]);
  select(world.placed.length - 1);
}

/** Do what was wished while this life was being prepared, before it begins. */
async function doKept() {
  const { blocks = 0, ...values } = recall("kept", {});
  remember("kept", {});
  if (Object.keys(values).length) change(values);
  for (let i = 0; i < blocks; i++) add();
  while (isBusy) await new Promise(requestAnimationFrame);
}

function drop() {
  if (typeof selected !== "number") return;
  place(world.placed.filter((_, i) => i !== selected));
  select(null);
}

/** Take the news of the world. */
function follow(news) {
  if (news.life !== undefined && news.life !== data.life) { location.reload(); return; }
  if (now.prepares && !news.prepares) remember("kept", {});  // that life could not be made
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
  judge();
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
  show("rate", nearest, `N = ${brief(world.rate * data.N)}`);
  show("left_wheel", world.left, `${Math.round(100 * world.left)} %`);
  show("right_wheel", world.right, `${Math.round(100 * world.right)} %`);
  $("lit").setAttribute("aria-pressed", world.lit);
  $("sensors").querySelectorAll("button").forEach((button, i) => button.setAttribute("aria-pressed", world.dead.includes(i)));
  $("play").textContent = shown.playing ? "Pause" : "Play";
  $("speed").value = shown.speed;
  $("new").disabled = Boolean(now.prepares);
  const goal = data.hasTrials ? "Either end may be the rewarded one." : shown.side === "right" ? "Evolved to turn right, since the lamp is on." : "Evolved to turn left, since the lamp is off.";
  $("outcome").textContent = now.trouble ? `The world has stopped: ${now.trouble}` : now.prepares ? `Preparing ${now.prepares} …`
    : verdict ? sentence() : now.over ? "This life has ended. Save it, or begin a new one." : `${goal} Disturb it.`;
  showChallenge();
}
