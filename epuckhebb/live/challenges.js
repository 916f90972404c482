// ---- Challenges, other robots, and links ----

const LIGHT = ["scenario=highlight", "genome=reference", "hebbian=paper", "adaptation=none", "seed=1"];
const DIM = LIGHT.with(0, "scenario=lowlight"), BASE = LIGHT.with(0, "scenario=base");
const wrongArm = () => own.some((life) => life.x.subarray(0, samples).some((x) => x < -0.25));

// may: what one may change; wants: whether each robot shall succeed; also: what else must hold.
const CHALLENGES = {
  sun: { name: "The sun", words: LIGHT, side: "left", may: ["light"], wants: [false, false],
    task: "Find the light at which both robots fail. Move the sun, nothing else." },
  block: { name: "One block", words: BASE, side: "right", may: ["placed"], wants: [false, true],
    also: () => world.placed.length === 1,
    task: "Make only the plastic robot succeed, with one block. Add it, and move it." },
  harm: { name: "Too much", words: BASE, side: "right", may: ["rate"], wants: [true, false],
    task: "Make plasticity do harm: only the robot without it succeeds. Move the plasticity, nothing else." },
  blind: { name: "Two blind sensors", words: BASE, side: "right", may: ["dead_sensors"], wants: [true, true],
    also: () => world.dead.length >= 2,
    task: "Blind two sensors, or more, so that both robots still succeed." },
  arm: { name: "Wrong arm", words: BASE, side: "right", may: ["put"], wants: [true, true],
    also: wrongArm,
    task: "The goal is on the right. Drag the robots into the left arm, so that both still succeed." },
  rare: { name: "A rare robot", words: DIM, side: "right", may: [], wants: [false, true], isDrawn: true,
    also: () => !data.words.includes("genome=reference"),
    task: "In dim light, find another robot that fails without plasticity and succeeds with it. Press Another robot until you have one." },
};

const keyOf = (word) => word.split("=")[0].split(".")[0];
/** Words with some settings in the place of others of their kind. */
const withWords = (words, settings) => [...words.filter((word) => !settings.some((one) => keyOf(one) === keyOf(word))), ...settings];

let challenge = CHALLENGES[recall("challenge", "")] ? recall("challenge", "") : "";
const sameWorld = (words, side) => side === data.sides[0] && words.every((word) => keyOf(word) === "genome" || data.words.includes(word));
if (challenge && !sameWorld(CHALLENGES[challenge].words, CHALLENGES[challenge].side)) challenge = "";

const anyChampion = () => {
  const others = data.champions.filter((name) => !data.words.includes(`genome=${name}`));
  return others[Math.floor(Math.random() * others.length)];
};

/** Begin a new life. */
const begin = (words, side = data.sides[0], changes = []) => ask({ do: "new", words, side, changes });

function takeUp(name) {
  remember("challenge", name);
  const { words, side, isDrawn } = CHALLENGES[name] ?? { words: data.typed, side: data.sides[0] };
  begin(isDrawn ? withWords(words, [`genome=${anyChampion()}`]) : words, side);
}

/** A new life with what is chosen in the settings. */
function newLife() {
  const settings = ["hebbian", "adaptation"].filter((id) => $(id).value).map((id) => `${id}=${$(id).value}`);
  const seed = Number($("seed").value) === data.seed ? [] : [`seed=${$("seed").value}`];
  begin(withWords(data.words, [...settings, ...seed]), $("side").value);
}

/** A new life of another champion, all of which have the paper's network. */
const anotherRobot = () => begin(withWords(data.words.filter((word) => !["network", "robot"].includes(keyOf(word))), [`genome=${anyChampion()}`]));

/** Say whether the challenge is met; the button of each that was met has a tick. */
function showChallenge() {
  const text = challenge ? `${CHALLENGES[challenge].task} ${judgement()}` : "Drag the robot, dim the sun, put a block in its way: all robots get the same. Or choose a challenge.";
  if ($("task").textContent !== text) $("task").textContent = text;
  for (const button of $("challenges").children) {
    button.setAttribute("aria-pressed", button.dataset.name === challenge);
    button.textContent = (recall("met", []).includes(button.dataset.name) ? "✓ " : "") + (CHALLENGES[button.dataset.name]?.name ?? "Free play");
  }
}

const strangers = ({ may }) => now.keys.filter((key) => key !== "at_s" && !may.includes(key));
const isMet = (one) => !strangers(one).length && (one.also?.() ?? true) && one.wants.every((want, c) => want === verdict[c]);

let lastWord = null;  // what was said at the end of the life stays

function judgement() {
  const one = CHALLENGES[challenge], other = strangers(one);
  if (lastWord) return lastWord;
  if (other.length) return `You also changed ${other.join(", ").replaceAll("_", " ")}: press New life to try again.`;
  if (!verdict) return "";
  if (isMet(one)) remember("met", [...new Set([...recall("met", []), challenge])]);
  return lastWord = isMet(one) ? "Solved!" : one.isDrawn ? "Not this one: press Another robot." : "Not yet: press New life to try again.";
}

/** Put a link to this life, with all that was changed in it, on the clipboard. It holds no secret. */
async function share() {
  const life = await ask({ do: "link" });
  if (life.error) return;
  const address = `${location.origin}/#${encodeURIComponent(JSON.stringify(life))}`;
  await toClipboard(address, "A link to this life, with all that you changed, is on the clipboard. It opens on any computer on which epuckhebb play runs.");
}

async function toClipboard(text, done) {
  try {
    await navigator.clipboard.writeText(text);
    $("saved").textContent = done;
  } catch {
    $("saved").textContent = text;
  }
}

/** Begin the life that the address names. */
function openLink() {
  history.replaceState(null, "", `#${secret}`);
  try {
    const { words, side, changes } = JSON.parse(behind);
    begin(words, side, changes);
  } catch {
    complain("this link is not whole");
  }
}
