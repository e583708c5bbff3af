"use strict";
// The line to the server. One request for numbers is under way at a time; when its answer is painted, the newest
// values are asked for: nothing that is painted is older than what was asked last.
(() => {
  let socket = null, id = 0, waiting = null, pending = null, wait = 500, ready = false;

  const connected = (yes) => {
    const place = LF.$("connection");
    place.classList.toggle("lost", !yes);
    place.textContent = yes ? "" : "connection lost: is lightfield still running? trying again…";
  };

  const connect = () => {
    socket = new WebSocket(`ws://${location.host}/socket`);
    socket.binaryType = "arraybuffer";
    socket.onopen = () => { wait = 500; waiting = pending = null; connected(true); };
    socket.onmessage = (event) => (typeof event.data === "string" ? told(JSON.parse(event.data)) : numbers(event.data));
    socket.onclose = () => { connected(false); setTimeout(connect, wait); wait = Math.min(8000, wait * 1.6); };
  };

  const send = (request) => {
    if (!socket || socket.readyState !== WebSocket.OPEN) return LF.say("not connected: nothing was changed");
    id += 1;
    waiting = id;
    socket.send(JSON.stringify({ ...request, id }));
  };

  LF.ask = (request) => {
    LF.say("");
    if (request.do !== "set" || request.done) {
      if (pending) send({ ...pending, done: true });
      pending = null;
      send(request);
    } else if (waiting === null) send(request);
    else pending = pending ? { ...request, values: { ...pending.values, ...request.values } } : request;
  };

  const answered = (answer) => {
    if (answer === null || answer === undefined || answer < waiting) return;
    waiting = null;
    if (pending) { const request = pending; pending = null; send(request); }
  };

  const told = (message) => {
    if (message.type === "experiment") { LF.structure = null; LF.showExperiment(message); ready = true; }
    else if (message.type === "state") LF.showState(message);
    else if (message.type === "job") job(message);
    else if (message.type === "made") made();
    else if (message.type === "error") { LF.say(message.message); answered(message.id); if (LF.state) { LF.structure = null; LF.showState(LF.state); } }
  };

  const numbers = (buffer) => {
    const length = new DataView(buffer).getUint32(0, true);
    const head = JSON.parse(new TextDecoder().decode(new Uint8Array(buffer, 4, length)));
    const arrays = {};
    let at = 4 + length;
    for (const [name, shape] of head.arrays) {
      const count = shape.reduce((a, b) => a * b, 1);
      arrays[name] = new Float32Array(buffer, at, count);
      at += 4 * count;
    }
    if (head.type === "errors") { if (LF.shown && LF.shown.plane === head.plane) { LF.errors = arrays.map_stderr; LF.showCursor(); } return; }
    // Other pages may be looking too: their answers carry no number.
    if (head.id !== null && head.id < waiting) return;
    LF.showEvaluation(head, arrays);
    if (!head.answers) LF.say("this water scatters more than the trace can answer: press Trace anew");
    else if (!answers) LF.say("");
    answers = head.answers;
    offer();
    if (LF.state) LF.showLadder(LF.state);
    // The answer counts as painted when a frame was drawn.
    requestAnimationFrame(() => {
      const root = document.documentElement;
      root.dataset.painted = String(Number(root.dataset.painted || 0) + 1);
      answered(head.id);
    });
  };

  // Also where the light on the planes was cancelled.
  let answers = true;
  const offer = () => { anew.hidden = answers && (LF.busy || !LF.shown || Boolean(LF.shown.map_render)); };
  const anew = LF.make("button", { type: "button", id: "trace", hidden: true }, "Trace anew");
  anew.addEventListener("click", () => LF.ask({ do: "trace" }));
  LF.$("fit").parentElement.append(anew);

  // What keeps the session busy comes first; if that is soon over, nobody needs to be told.
  const SOON_MS = 500;
  let later = null, wanted = false;
  const job = (message) => {
    const { job, doing, failed } = message, busy = doing || job;
    LF.busy = Boolean(busy);
    offer();
    clearTimeout(later);
    const show = () => {
      LF.$("job").hidden = !busy && !failed;
      LF.$("job-text").textContent = failed || (doing ? doing.stage : job ? `${job.name}: ${job.stage}` : "");
      const known = busy && busy.part !== null;
      LF.$("job-part").hidden = !known;
      LF.$("job-moving").hidden = known || !busy;
      LF.$("job-percent").textContent = known ? `${Math.round(100 * busy.part)} %` : "";
      if (known) LF.$("job-part").value = busy.part;
    };
    if (doing && message.ready && LF.$("job").hidden) later = setTimeout(show, SOON_MS);
    else show();
    LF.$("cancel").hidden = !message.ready || !busy;
    for (const id of ["diagnose", "report", "trace"]) LF.$(id).disabled = Boolean(job);
  };

  LF.$("report").addEventListener("click", () => { wanted = true; LF.$("save-menu").open = false; LF.ask({ do: "report" }); });
  const made = () => {
    LF.$("save-comparison").hidden = false;
    if (wanted) LF.$("save-comparison").click();
    wanted = false;
  };

  LF.$("snapshot").addEventListener("submit", (event) => {
    event.preventDefault();
    LF.ask({ do: "keep", name: LF.$("snapshot-name").value });
    LF.$("snapshot-name").value = "";
  });

  LF.$("own").addEventListener("submit", (event) => {
    event.preventDefault();
    const parameters = LF.$("own-parameters").value.trim().split("\n").map((line) => {
      // Commas part what nothing else does; beside blanks they are points.
      const [name, low, high, neutral] = line.trim().split(/\s/.test(line.trim()) ? /,?\s+/ : ",");
      return { name, low: LF.read(low || ""), high: LF.read(high || ""), neutral: neutral === undefined ? null : LF.read(neutral) };
    });
    LF.ask({ do: "own", name: LF.$("own-name").value, stage: LF.$("own-stage").value, formula: LF.$("own-formula").value, parameters });
  });

  const bytesOf = (file) => new Promise((done, failed) => {
    const reader = new FileReader();
    reader.onload = () => done(reader.result.slice(reader.result.indexOf(",") + 1)); // base 64
    reader.onerror = failed;
    reader.readAsDataURL(file);
  });
  const drop = async (files) => {
    const read = await Promise.all([...files].map(async (file) => ({ name: file.name, content: file.size ? await bytesOf(file) : "" })));
    if (read.length) LF.ask({ do: "drop", files: read, units: LF.$("units").value });
  };
  LF.$("file").addEventListener("change", (event) => { drop(event.target.files); event.target.value = ""; LF.$("save-menu").open = false; });
  document.addEventListener("dragover", (event) => { event.preventDefault(); LF.$("drop").hidden = false; });
  document.addEventListener("dragleave", (event) => { if (!event.relatedTarget) LF.$("drop").hidden = true; });
  document.addEventListener("drop", (event) => { event.preventDefault(); LF.$("drop").hidden = true; drop(event.dataTransfer.files); });

  // A machine that slept: the line may be dead although nobody said so.
  window.addEventListener("online", () => socket.close());

  connect();
})();
