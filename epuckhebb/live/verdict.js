// ---- Who arrives, who leaves, and how a life ends ----

const END_OF_LIFE = data.verdict === null ? Infinity : Math.floor(data.verdict / data.interval + 1e-6);  // steps
const hasFlags = data.verdict !== null;
let verdict = null;  // for each robot whether it was at the goal at the end of the life; null until then

const goalNow = () => data.worlds.at(-1).goals[data.sides[0]];
const isHome = (life, k) => Math.hypot(life.x[k] - goalNow()[0], life.y[k] - goalNow()[1]) <= maze.goalRadius;

/** Note who is at the goal, from a sample on; tells what is new. */
function notice(since) {
  if (!hasFlags) return;
  own.forEach((life, c) => {
    for (let k = since; k < samples && k <= END_OF_LIFE; k++) {
      const isThere = isHome(life, k);
      if (isThere === (life.visits.at(-1)?.isThere ?? false)) continue;
      life.visits.push({ k, isThere });
      if (isThere) life.arrival ??= k * data.interval;
      tell(k, `${data.controllers[c]} ${isThere ? "arrives at" : "leaves"} the goal`);
    }
  });
}

/** Judge the life once its end is there: whoever is at the goal then succeeds, as in the paper. */
function judge() {
  const last = now.over ? Math.min(END_OF_LIFE, samples - 1) : END_OF_LIFE;
  if (verdict || !hasFlags || samples <= last) return;
  verdict = own.map((life) => isHome(life, last));
  const known = recall("score", {}), here = known.secret === secret ? known : { secret, lives: {} };
  if (!here.lives[data.life]) {  // and not when the page is loaded anew
    here.lives[data.life] = { names: data.controllers, won: verdict, genome: data.genome };
    remember("score", here);
    setPlaying(false);
    seek(last * data.interval);  // as fast as it goes, it is past it
    verdict.forEach((won, c) => tell(last, `${data.controllers[c]} ${won ? "succeeds" : "fails"}`));
  }
  showScore(here.lives);
}

function tell(k, text) {
  $("said").textContent = text;
  log(`${(k * data.interval).toFixed(1)} s: ${text}`);
}

/** How many lives ended at the goal, those without plasticity first. */
function showScore(lives) {
  const ended = Object.values(lives), pairs = ended.filter(({ names }) => names.length === 2);
  const rows = [...new Set(ended.flatMap(({ names }) => names))].map((name) => {
    const of = ended.filter(({ names }) => names.includes(name));
    return [name, of.filter(({ names, won }) => won[names.indexOf(name)]).length, of.length];
  });
  if (pairs.length) rows.push(["Fails without, succeeds with", pairs.filter(({ won: [before, after] }) => !before && after).length, pairs.length]);
  const robots = new Set(ended.map(({ genome }) => genome)).size;
  const caption = `Score: ${ended.length} ${ended.length === 1 ? "life" : "lives"}, ${robots} ${robots === 1 ? "robot" : "robots"}`;
  $("score").replaceChildren(element("caption", { textContent: caption }), ...rows.map(([name, some, all]) =>
    element("tr", {}, element("th", { scope: "row", textContent: name }), element("td", { textContent: `${some} of ${all}` }))));
  $("score").hidden = ended.length === 0;
}

/** The flag of a robot at a time: a sign, a word, and what kind it is. */
function flag(life, c, t) {
  if (!hasFlags) return ["", "", ""];
  const k = Math.floor(t / data.interval + 1e-6), visit = life.visits.findLast((one) => one.k <= k);
  if (verdict && k >= END_OF_LIFE - 1) return verdict[c] ? ["✓", "succeeded", "won"] : ["✗", "failed", "lost"];
  if (!visit) return ["", "", ""];
  const at = `${(visit.k * data.interval).toFixed(0)} s`;
  return visit.isThere ? ["⚑", `at goal since ${at}`, "there"] : ["⚐", `left goal at ${at}`, "left"];
}

/** The end of the life in a sentence. */
function sentence() {
  const all = data.controllers, winners = all.filter((_, c) => verdict[c]), others = all.filter((_, c) => !verdict[c]);
  const every = all.length === 2 ? "both robots" : all.length > 2 ? "all robots" : "the robot";
  const verb = (word, who) => (who.length === 1 ? `${word}s` : word);
  const what = !others.length ? `${every} ${verb("succeed", all)}` : !winners.length ? `${every} ${verb("fail", all)}`
    : `${winners.join(", ")} ${verb("succeed", winners)}, ${others.join(", ")} ${verb("fail", others)}`;
  return `After ${Math.round(data.verdict)} s, the paper’s end of life: ${what}.`;
}
