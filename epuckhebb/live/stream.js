// ---- What comes from the program ----

const headers = { "X-Epuckhebb": location.hash.slice(1) };
const WORLD = 0, SAMPLES = 1;
const said = document.getElementById("outcome");
let reader, rest = new Uint8Array(0);

async function connect() {
  const answer = await fetch("/stream", { headers });
  if (!answer.ok) throw new Error("This is not the whole address: open the one that `epuckhebb play` printed, with all that follows the #.");
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
data.worlds = [data.world];
data.changes = [];
const { maze, robot, layers } = data;

/** Ask for something; returns the answer, and shows why it cannot be. */
async function ask(wish) {
  let answer;
  try {
    answer = await (await fetch("/do", { method: "POST", headers, body: JSON.stringify(wish) })).json();
  } catch {
    answer = { error: "the program did not answer" };
  }
  document.getElementById("trouble").textContent = answer.error ?? "";
  return answer;
}
