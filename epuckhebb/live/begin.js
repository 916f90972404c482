// ---- How it begins ----

const setSpeed = (speed) => { shown.speed = speed; ask({ do: "speed", value: speed }); };
const setPlaying = (on) => { shown.playing = on; $("play").textContent = on ? "Pause" : "Play"; ask({ do: "play", value: on }); if (on) seek(END); redraw(); };
const faster = (by) => setSpeed(data.speeds[Math.max(0, Math.min(data.speeds.length - 1, data.speeds.indexOf(shown.speed) + by))]);
const press = (id) => () => $(id).click();
let command = "";

async function save() {
  $("saved").textContent = "Saving: the life is run once more, as `epuckhebb evaluate` does it …";
  const { run, same, command: typed } = await ask({ do: "save" });
  if (!run) { $("saved").textContent = ""; return; }
  command = typed;
  $("copy").disabled = false;
  $("saved").textContent = `${run}: ${same ? "run again, it is the same to the last bit" : "run again, it went otherwise: please tell us"}. See it again with: epuckhebb replay ${run} --open`;
}

const acts = {
  lit: () => change({ lamp_on: !world.lit }), add, drop, reset: () => change({ reset: true }), save, share,
  copy: () => toClipboard(command, `Copied: ${command}`), new: newLife, another: anotherRobot,
  play: () => setPlaying(!shown.playing),
  step: () => { seek(END); ask({ do: "step" }); },
  now: () => seek(END),
  theme: () => { changeScheme(); repaint(); },
};

document.querySelector("main").hidden = $("transport").hidden = false;
$("title").textContent = data.title;
document.documentElement.dataset.side = data.sides[0];
for (const speed of data.speeds) $("speed").append(element("option", { value: speed, textContent: speed ? `${speed}×` : "fastest" }));
for (const [id, choices] of Object.entries(data.choices)) {
  $(id).append(element("option", { value: "", textContent: "as now" }));
  $(id).append(...Object.keys(choices).map((choice) => element("option", { value: choice, textContent: choice.replaceAll("_", " ") })));
  $(id).addEventListener("change", (event) => { $("meaning").textContent = choices[event.target.value] ?? ""; });
}
for (const name of ["", ...Object.keys(CHALLENGES)]) {
  const button = element("button", { type: "button" });
  button.dataset.name = name;
  button.addEventListener("click", () => takeUp(name));
  $("challenges").append(button);
}
$("challenges").hidden = $("task").hidden = data.hasTrials;
$("side").value = data.sides[0];
$("seed").value = data.seed;
robot.distances.forEach((_, i) => {
  const button = element("button", { type: "button", textContent: i, title: data.inputs[LIGHTS + i] });
  button.setAttribute("aria-label", `blind: ${data.inputs[LIGHTS + i]}`);
  button.addEventListener("click", () => change({ dead_sensors: world.dead.includes(i) ? world.dead.filter((n) => n !== i) : [...world.dead, i].sort((a, b) => a - b) }));
  $("sensors").append(button);
});
$("light").addEventListener("input", (event) => change({ light: Number(event.target.value) }));
$("intensity").addEventListener("input", (event) => change({ lamp: { intensity: Number(event.target.value) } }));
$("rate").addEventListener("input", (event) => change({ rate: RATES[event.target.value] }));
for (const wheel of ["left_wheel", "right_wheel"]) $(wheel).addEventListener("input", (event) => change({ [wheel]: Number(event.target.value) }));
for (const [id, act] of Object.entries(acts)) $(id).addEventListener("click", act);
for (const input of document.querySelectorAll(".slide input")) input.addEventListener("pointerdown", () => drag(true));
for (const kind of ["pointerup", "pointercancel"]) addEventListener(kind, () => { hand = null; drag(false); redraw(); });
$("speed").addEventListener("change", (event) => setSpeed(Number(event.target.value)));
$("time").addEventListener("input", (event) => seek(Number(event.target.value)));
dark.addEventListener("change", repaint);
addEventListener("resize", repaint);
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.metaKey || event.altKey || event.target.matches("select, input")) return;
  const act = {
    " ": event.target.matches("button") ? undefined : acts.play, "+": () => faster(1), "=": () => faster(1), "-": () => faster(-1), ArrowRight: acts.step,
    l: press("lit"), b: press("add"), f: press("reset"), r: press("new"), a: press("another"), d: press("theme"),
    Delete: press("drop"), Backspace: press("drop"), Escape: () => select(null),
  }[event.key.length === 1 ? event.key.toLowerCase() : event.key];
  if (!act) return;
  event.preventDefault();
  act();
});

const charts = [
  { name: "fitness", heading: "Live fitness, F", note: "how well the robot is doing at this moment; 1 is best" },
  { name: "changeSignal", heading: "Change signal", note: "how unlike the training world things are" },
  { name: "rate", heading: "Effective rate, Nₑ", note: "how strongly this moment may change the connections" },
  { name: "weightChange", heading: "Weight change", note: "how far all connections together are from the initial weights" },
];
views = data.controllers.map((_, c) => new LiveMaze(c));
views = [
  ...views,
  ...data.controllers.map((_, c) => new LiveNetwork(c)),
  ...charts.filter(({ name }) => name !== "changeSignal" || data.hasSignal).map((chart) => new LiveChart(chart)),
];
$("mazes").classList.toggle("alone", data.controllers.length === 1);
const sight = new IntersectionObserver((changes) => {
  for (const { target, isIntersecting } of changes) isIntersecting ? inSight.add(target) : inSight.delete(target);
  redraw();
});
for (const view of views) sight.observe(view.figure);
$("chart-keys").append(
  ...data.controllers.map((title) => element("span", { className: "value" }, element("span", { className: "key" }), title)),
  "Pink marks: changes by hand. Dashed: arrival at the goal.");

/** For the console and for tests: `live.state()`. */
window.live = { maze, costs, state: () => ({ ...shown, samples, END, following, now, world, selected, robots: own.map((life) => poseAt(life, shown.t)), worlds: data.worlds.length }), change, seek };

if (hasFlags) showScore(recall("score", {}).secret === secret ? recall("score").lives : {});
controls();
repaint();
if (isLink) openLink();
addEventListener("hashchange", () => location.reload());
let isNew = true;
try {
  for (;;) {
    const { kind, payload } = await frame();
    if (kind === WORLD) follow(decoded(payload));
    else if (kind === SAMPLES) take(payload);
    if (kind === SAMPLES && isNew) {
      isNew = false;  // a new life waits for its page
      await doKept();
      if (samples === 1 && !isLink && !matchMedia("(prefers-reduced-motion: reduce)").matches) setPlaying(true);
    }
    redraw();
  }
} catch (error) {
  $("outcome").textContent = "The program has ended, and this world with it.";
  $("trouble").textContent = error.message === "the program has ended" ? "" : error.message;
}
