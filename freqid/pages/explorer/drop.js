// A file that is dropped on the page, or chosen, goes to this machine's own server in pieces.
const PIECE = 2 ** 19;
let file = null, key = "";

const say = text => { document.getElementById("dropped").textContent = text; };
const random = () => [...crypto.getRandomValues(new Uint8Array(8))]
  .map(byte => byte.toString(16).padStart(2, "0")).join("");
const asked = (path, more, body) =>
  fetch(path + "?" + new URLSearchParams([["key", key], ["name", file.name], ...more]),
        {method: "POST", body}).then(answer => answer.json());

async function send(chosen) {
  file = chosen;
  key = random();
  document.getElementById("channels").replaceChildren();
  for (let at = 0; at < file.size || at === 0; at += PIECE) {
    say(`reading ${file.name}: ${Math.round(100 * at / Math.max(file.size, 1))} %`);
    const told = await asked("/piece", [["at", at]], file.slice(at, at + PIECE));
    if (told.error) return say(told.error);
  }
  read([]);
}

async function read(channels) {
  say(`reading ${file.name} …`);
  const told = await asked("/read", channels);
  if (!told.error) return location.assign("?data=" + key);
  say(told.error);
  choose(told.channels);
}

// what is driven and what is measured, where the file does not say
function choose(names) {
  const box = document.getElementById("channels");
  box.replaceChildren();
  if (names.length < 2) return;
  const selects = ["input", "output"].map((end, number) => {
    const label = document.createElement("label"), select = document.createElement("select");
    select.append(...names.map(name => new Option(name, name)));
    select.selectedIndex = number;
    label.append(end + " ", select);
    box.append(label);
    return [end, select];
  });
  const button = document.createElement("button");
  button.type = "button";
  button.textContent = "read these";
  button.addEventListener("click", () => read(selects.map(([end, s]) => [end, s.value])));
  box.append(button);
}

document.addEventListener("click", event => {
  if (event.target.id !== "choose") return;
  const input = document.createElement("input");
  input.type = "file";
  input.addEventListener("change", () => input.files.length && send(input.files[0]));
  input.click();
});
for (const kind of ["dragover", "dragleave", "drop"])
  document.addEventListener(kind, event => {
    event.preventDefault();
    const box = document.getElementById("drop");
    if (box) box.classList.toggle("over", kind === "dragover");
    if (kind === "drop" && event.dataTransfer.files.length) send(event.dataTransfer.files[0]);
  });
