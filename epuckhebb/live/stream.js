// ---- What comes from the program ----

const WORLD = 0, SAMPLES = 1;
const said = document.getElementById("outcome");
let reader, rest = new Uint8Array(0);

// Behind the # is the secret of the program, or a link: a life to begin. A link holds no secret.
const behind = decodeURIComponent(location.hash.slice(1)), isLink = behind.startsWith("{");
const secret = isLink ? recall("secret", "", localStorage) : behind;
if (!isLink) remember("secret", secret, localStorage);
const headers = { "X-Epuckhebb": secret };

/** What a browser keeps under a name; a frame may not keep anything. */
function recall(name, otherwise, where = sessionStorage) {
  try { return JSON.parse(where.getItem(name)) ?? otherwise; } catch { return otherwise; }
}

function remember(name, value, where = sessionStorage) {
  try { where.setItem(name, JSON.stringify(value)); } catch { /* see above */ }
}

async function connect() {
  const answer = await fetch("/stream", { headers });
  if (!answer.ok) throw new Error(isLink ? "This link is for a page of `epuckhebb play`: open the address that the program printed, then this link." : "This is not the whole address: open the one that `epuckhebb play` printed, with all that follows the #.");
  reader = answer.body.getReader();
}

/** The next frame: its kind and its content. */
async function frame() {
  for (;;) {
    if (rest.length >= 8) {
      const head = new DataView(rest.buffer, rest.byteOffset), length = head.getUint32(0, true), kind = head.getUint32(4, true);
      if (rest.length >= 8 + length) {
        const payload = rest.slice(8, 8 + length);
        rest = rest.subarray(8 + length);
        return { kind, payload };
      }
    }
    const { value, done } = await reader.read();
    if (done) throw new Error("the program has ended");
    const joined = new Uint8Array(rest.length + value.length);
    joined.set(rest);
    joined.set(value, rest.length);
    rest = joined;
  }
}

const decoded = (payload) => JSON.parse(new TextDecoder().decode(payload));
let data;
try {
  await connect();
  data = decoded((await frame()).payload);
} catch (error) {
  said.textContent = error instanceof TypeError ? "The program that printed this address has ended." : error.message;
  return;
}

const { maze, robot, layers } = data;

let asker = null;  // what was last used; why something cannot be is said beside it
for (const kind of ["click", "input", "pointerdown"]) {
  document.addEventListener(kind, ({ target }) => { asker = target.closest("button, label, canvas") ?? asker; }, true);
}

/** Ask for something; returns the answer, and shows why it cannot be. */
async function ask(wish) {
  let answer;
  try {
    answer = await (await fetch("/do", { method: "POST", headers, body: JSON.stringify(wish) })).json();
  } catch {
    answer = { error: "the program did not answer" };
  }
  if (answer.error) complain(answer.error);
  else $("trouble").textContent = "";
  return answer;
}

function complain(text) {
  (asker?.closest("#mazes, #flocks") ?? asker ?? $("outcome")).after($("trouble"));
  $("trouble").textContent = text;
}
