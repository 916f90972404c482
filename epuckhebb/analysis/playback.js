// ---- Playback of a record; the page has SPEEDS, `shown`, END, `paint` and `link` ----

const PLAY = "M3 1.5v13L14 8z", PAUSE = "M3 2h3.5v12H3zM9.5 2H13v12H9.5z";
let wanted = 0, last = 0;
if (location.hash === "#preview") {  // in a gallery: robots and time alone, in its colours
  document.documentElement.dataset.preview = "";
  addEventListener("message", ({ data: wish }) => wish === "theme" && $("theme").click());
}

/** Numbers from little-endian 16-bit integers in base64, times a step. */
function unpacked({ step, numbers }, count) {
  const values = new Float32Array(count), bytes = atob(numbers);
  for (let i = 0; 2 * i < bytes.length; i++) {
    values[i] = step * ((bytes.charCodeAt(2 * i) | (bytes.charCodeAt(2 * i + 1) << 8)) << 16 >> 16);
  }
  return values;
}

/** Ask for one more picture. */
function redraw() {
  wanted ||= requestAnimationFrame(picture);
}

function picture(now) {
  wanted = 0;
  if (shown.playing) {
    // A page that was hidden or slow resumes where it was; a picture's time can be before the click on play.
    shown.t = Math.min(END, shown.t + Math.max(0, Math.min(100, now - last)) / 1000 * shown.speed);
    last = now;
    if (shown.t === END) pause();
    else redraw();
  }
  $("time").value = shown.t;
  paint(now);
}

function play() {
  if (shown.t === END) shown.t = 0;
  shown.playing = true;
  last = performance.now();
  buttons();
  redraw();
}

function pause() {
  shown.playing = false;
  redraw();
  buttons();
  link();
}

function buttons() {
  $("play").setAttribute("aria-label", shown.playing ? "Pause" : "Play");
  $("play").title = `${shown.playing ? "Pause" : "Play"} (Space)`;
  $("play").querySelector("path").setAttribute("d", shown.playing ? PAUSE : PLAY);
}

/** Go to a moment [s]. */
function seek(t) {
  shown.t = Math.max(0, Math.min(END, t));
  redraw();
}

function setSpeed(speed) {
  shown.speed = speed;
  $("speed").value = speed;
}

/** Go so many speeds up. */
function faster(by) {
  setSpeed(SPEEDS[Math.max(0, Math.min(SPEEDS.length - 1, SPEEDS.indexOf(shown.speed) + by))]);
}

/** Let the controls play the record. */
function setUpPlayback() {
  for (const speed of SPEEDS) $("speed").append(element("option", { value: speed, textContent: `${speed}×` }));
  setSpeed(shown.speed);
  $("time").max = END;
  $("time").step = "any";
  $("play").addEventListener("click", () => (shown.playing ? pause() : play()));
  $("speed").addEventListener("change", (event) => setSpeed(Number(event.target.value)));
  $("time").addEventListener("input", (event) => seek(Number(event.target.value)));
  $("time").addEventListener("change", link);
}
