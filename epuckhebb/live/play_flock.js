// ---- A flock that someone disturbs ----

const SHOWN_S = 600, WAY = { ArrowLeft: [-1, 0], ArrowRight: [1, 0], ArrowUp: [0, 1], ArrowDown: [0, -1] };
let now = data, wanted = 0, hand = null, speedBefore = null, isBusy = false, place = null;
const course = [], marks = [];  // [time, cosine] of the last minutes, and when something was done

class LiveFlock extends FlockPicture {
  poses() {
    return now.poses.map(([x, y, heading], i) => (hand && i === this.selected ? { ...hand, heading } : { x, y, heading }));
  }

  weightsAt() {
    return now.weights.flat();
  }

  brokenAt() {
    return now.broken;
  }

  cosineAt() {
    const intact = now.poses.filter((_, i) => i !== now.broken);
    return intact.reduce((sum, [, , heading]) => sum + Math.cos(heading), 0) / intact.length;
  }

  /** Where on the plane a point of the picture is [m]. */
  placeOf(event) {
    const { x, y, scale } = this.frame;
    return { x: x + (event.offsetX - this.canvas.clientWidth / 2) / scale, y: y - (event.offsetY - this.height / 2) / scale };
  }
}

const flock = new LiveFlock("", 460);

function redraw() {
  wanted ||= requestAnimationFrame(() => {
    wanted = 0;
    flock.draw(0);
    chart();
    $("clock").textContent = `${(now.steps * data.interval / 60).toFixed(1)} min`;
  });
}

function repaint() {
  readColours();
  flock.resize();
  redraw();
}

function chart() {
  const height = 130, pen = fit($("chart"), () => height), width = $("chart").clientWidth, until = now.steps * data.interval;
  const from = Math.max(0, until - SHOWN_S), X = (t) => 30 + (t - from) / Math.max(60, until - from) * (width - 36), Y = (value) => 8 + (1 - value) / 2 * (height - 30);
  pen.fillStyle = colours.soft;
  pen.strokeStyle = colours.line;
  for (const value of [-1, 0, 1]) {
    pen.fillText(String(value).replace("-", "−"), 8, Y(value) + 4);
    pen.strokeRect(30, Y(value), width - 36, 0);
  }
  pen.strokeStyle = colours.near;
  for (const t of marks.filter((t) => t >= from)) pen.strokeRect(X(t), height - 26, 0, 8);
  pen.strokeStyle = colours.left;
  pen.lineWidth = 2;
  pen.beginPath();
  for (const [t, value] of course) if (t >= from) pen.lineTo(X(t), Y(value));
  pen.stroke();
}

async function change(values) {
  marks.push(now.steps * data.interval);
  return ask({ do: "change", values });
}

/** Move the chosen robot; while one move is on its way, a newer one replaces it. */
async function move(x, y) {
  place = [flock.selected, x, y];
  if (isBusy) return;
  isBusy = true;
  while (place) {
    const put = place;
    place = null;
    await change({ put });
  }
  isBusy = false;
}

function choose(robot) {
  flock.selected = robot;
  $("chosen").textContent = robot === null ? "No robot is chosen."
    : `Robot ${robot + 1} is chosen: ${robot === now.broken ? "it is broken" : robot < data.knowers ? "it knows the way" : "it follows others"}.`;
  $("break").disabled = robot === null || now.broken >= 0;
  redraw();
}

const setSpeed = (speed) => ask({ do: "speed", value: speed });
const faster = (by) => setSpeed(data.speeds[Math.max(0, Math.min(data.speeds.length - 1, data.speeds.indexOf(now.speed) + by))]);

function follow(news) {
  if (news.life !== undefined && news.life !== data.life) { location.reload(); return; }
  const isChanged = news.broken !== now.broken;
  now = news;
  const t = now.steps * data.interval;
  if (t > (course.at(-1)?.[0] ?? -1) + 0.5) course.push([t, flock.cosineAt()]);
  while (course.length && course[0][0] < t - SHOWN_S) course.shift();
  if (isChanged) choose(flock.selected);
  flock.title.textContent = data.couplings[now.coupling][0];
  $("coupling").value = now.coupling;
  $("meaning").textContent = data.couplings[now.coupling][1];
  $("play").textContent = now.playing ? "Pause" : "Play";
  $("speed").value = now.speed;
  $("outcome").textContent = now.trouble ? `The flock has stopped: ${now.trouble}` : now.prepares ? `Preparing ${now.prepares} …`
    : now.broken < 0 ? `${robots} robots drive to the goal. Break one.` : `Robot ${now.broken + 1} is broken: its heading is noise, and it no longer knows the way.`;
  redraw();
}

const acts = {
  play: () => ask({ do: "play", value: !now.playing }),
  next: () => choose(flock.selected === null ? 0 : (flock.selected + 1) % robots),
  break: () => change({ broken: flock.selected }),
  new: () => ask({ do: "new", words: [...data.words.filter((word) => !word.startsWith("seed=")), `seed=${1 + Math.floor(Math.random() * 1e6)}`] }),
  theme: () => { changeScheme(); repaint(); },
};
const press = (id) => () => $(id).click();

document.querySelector("main").hidden = $("transport").hidden = false;
for (const [name, [title]] of Object.entries(data.couplings)) $("coupling").append(element("option", { value: name, textContent: title }));
for (const speed of data.speeds) $("speed").append(element("option", { value: speed, textContent: speed ? `${speed}×` : "fastest" }));
for (const [id, act] of Object.entries(acts)) $(id).addEventListener("click", act);
$("coupling").addEventListener("change", (event) => change({ coupling: event.target.value }));
$("speed").addEventListener("change", (event) => setSpeed(Number(event.target.value)));
flock.canvas.tabIndex = 0;
flock.canvas.setAttribute("role", "application");
flock.canvas.addEventListener("pointerdown", (event) => {
  const { x, y } = flock.placeOf(event), far = now.poses.map((pose) => Math.hypot(pose[0] - x, pose[1] - y));
  const nearest = far.indexOf(Math.min(...far));
  if (far[nearest] > Math.max(1.5 * radius, 16 / flock.frame.scale)) return;
  choose(nearest);
  flock.canvas.setPointerCapture(event.pointerId);
  [hand, flock.isHeld, speedBefore] = [{ x, y }, true, now.speed];
  setSpeed(1);
});
flock.canvas.addEventListener("pointermove", (event) => {
  if (!hand) return;
  hand = flock.placeOf(event);
  move(hand.x, hand.y);
  redraw();
});
for (const kind of ["pointerup", "pointercancel"]) {
  addEventListener(kind, () => {
    if (!hand) return;
    [hand, flock.isHeld] = [null, false];
    setSpeed(speedBefore);
  });
}
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input")) return;
  const way = WAY[event.key], [x, y] = now.poses[flock.selected] ?? [];
  const act = way ? flock.selected !== null && (() => move(x + 0.05 * way[0], y + 0.05 * way[1])) : {
    " ": event.target.matches("button") ? undefined : acts.play, "+": () => faster(1), "=": () => faster(1), "-": () => faster(-1),
    t: acts.next, x: press("break"), r: acts.new, d: acts.theme,
  }[event.key.toLowerCase()];
  if (!act) return;
  event.preventDefault();
  act();
});
dark.addEventListener("change", repaint);
addEventListener("resize", repaint);

/** For the console and for tests: `live.state()`. */
window.live = { change, state: () => ({ ...now, selected: flock.selected, samples: now.steps }) };

repaint();
choose(null);
follow(data);
if (now.steps === 0) {
  ask({ do: "speed", value: 32 });
  if (!matchMedia("(prefers-reduced-motion: reduce)").matches) acts.play();
}
try {
  for (;;) follow(decoded((await frame()).payload));
} catch (error) {
  $("outcome").textContent = "The program has ended, and this flock with it.";
  $("trouble").textContent = error.message === "the program has ended" ? "" : error.message;
}
