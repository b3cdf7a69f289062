// Frequencies of tracks over time: drag to enlarge, double-click for all, click a point for its record; arrow keys go through the records.
(() => {
  const data = JSON.parse(document.getElementById("tracks-data").textContent);
  const root = document.getElementById("tracks-view");
  const [canvas, panel, play] = ["canvas", ".record", "button"].map((name) => root.querySelector(name));
  const text = (tag, words) => Object.assign(document.createElement(tag), { textContent: words });
  const colour = (k) => `hsl(${(k * 137.5 + 210) % 360} 65% 42%)`;
  const all = () => {
    const f = data.frequencies.flat().filter(Number.isFinite);
    const t = data.times;
    const [low, high] = f.length ? [f.reduce((a, b) => Math.min(a, b)), f.reduce((a, b) => Math.max(a, b))] : [0, 1];
    const margin = 0.04 * (high - low || 1), wide = 0.02 * (t[t.length - 1] - t[0] || 1);
    return { t: [t[0] - wide, t[t.length - 1] + wide], f: [low - margin, high + margin] };
  };
  const LEFT = 64, BOTTOM = 34;
  const still = document.createElement("canvas"); // all points, painted once a view
  let view = all(), chosen = null, drag = null, timer = null;

  const x = (t) => LEFT + ((t - view.t[0]) / (view.t[1] - view.t[0])) * (canvas.clientWidth - LEFT - 8);
  const y = (f) => canvas.clientHeight - BOTTOM - ((f - view.f[0]) / (view.f[1] - view.f[0])) * (canvas.clientHeight - BOTTOM - 8);
  const back = (px, py) => [
    view.t[0] + ((px - LEFT) / (canvas.clientWidth - LEFT - 8)) * (view.t[1] - view.t[0]),
    view.f[0] + ((canvas.clientHeight - BOTTOM - py) / (canvas.clientHeight - BOTTOM - 8)) * (view.f[1] - view.f[0]),
  ];
  const CLOCK = [60, 600, 3600, 21600, 86400, 172800, 604800, 2592000, 7776000, 31536000]; // a minute to a year
  const ticks = ([low, high], count, clock) => {
    const raw = (high - low) / count, ten = 10 ** Math.floor(Math.log10(raw));
    const step = (clock || [1, 2, 5, 10].map((k) => k * ten)).find((k) => k >= raw) || raw;
    return Array.from({ length: Math.floor(high / step) - Math.ceil(low / step) + 1 }, (_, k) => (Math.ceil(low / step) + k) * step);
  };
  const when = (seconds) => new Date(1000 * seconds).toISOString().slice(0, 16).replace("T", " ");

  function paint() {
    const scale = devicePixelRatio || 1, pen = still.getContext("2d"), ink = getComputedStyle(root).color;
    still.width = canvas.width = canvas.clientWidth * scale;
    still.height = canvas.height = canvas.clientHeight * scale;
    pen.scale(scale, scale);
    pen.font = "12px sans-serif";
    pen.fillStyle = pen.strokeStyle = ink;
    pen.textAlign = "right";
    for (const f of ticks(view.f, 6)) pen.fillText(Number(f.toPrecision(6)), LEFT - 6, y(f) + 4);
    pen.textAlign = "center";
    for (const t of ticks(view.t, 5, CLOCK)) pen.fillText(when(t), x(t), canvas.clientHeight - 14);
    pen.fillText("Hz", 14, 14);
    pen.strokeRect(LEFT, 8, canvas.clientWidth - LEFT - 8, canvas.clientHeight - BOTTOM - 8);
    for (const t of data.refused) pen.fillRect(x(t), canvas.clientHeight - BOTTOM - 6, 1, 6); // records that could not be used
    const seen = data.times.filter((t) => t >= view.t[0] && t <= view.t[1]).length;
    pen.save();
    pen.beginPath();
    pen.rect(LEFT, 8, canvas.clientWidth - LEFT - 8, canvas.clientHeight - BOTTOM - 8);
    pen.clip();
    data.tracks.forEach((_, k) => {
      pen.fillStyle = pen.strokeStyle = colour(k);
      data.times.forEach((t, r) => {
        const f = data.frequencies[r][k], half = data.halves[r][k];
        if (f === null || t < view.t[0] || t > view.t[1]) return;
        const size = seen > 1500 ? 1 : 2;
        pen.fillRect(x(t) - size, y(f) - size, 2 * size, 2 * size);
        if (half !== null && seen < 1500) pen.fillRect(x(t) - 0.5, y(f + half), 1, y(f - half) - y(f + half));
      });
    });
    pen.restore();
    draw();
  }

  function draw() {
    const scale = devicePixelRatio || 1, pen = canvas.getContext("2d");
    pen.setTransform(1, 0, 0, 1, 0, 0);
    pen.clearRect(0, 0, canvas.width, canvas.height);
    pen.drawImage(still, 0, 0);
    pen.scale(scale, scale);
    pen.strokeStyle = getComputedStyle(root).color;
    if (chosen) pen.strokeRect(x(data.times[chosen[0]]) - 6, y(data.frequencies[chosen[0]][chosen[1]]) - 6, 12, 12);
    if (drag && drag.to) pen.strokeRect(drag.from[0], drag.from[1], drag.to[0] - drag.from[0], drag.to[1] - drag.from[1]);
  }

  function nearest(px, py) {
    let best = null, least = 144;
    data.times.forEach((t, r) => data.frequencies[r].forEach((f, k) => {
      const far = f === null ? Infinity : (x(t) - px) ** 2 + (y(f) - py) ** 2;
      if (far < least) [best, least] = [[r, k], far];
    }));
    return best;
  }

  function show(point) {
    chosen = point;
    draw();
    if (!point) return panel.replaceChildren();
    const [r, track] = point, rows = document.createElement("table");
    const put = (cells, tag) => {
      rows.append(document.createElement("tr"));
      cells.forEach((cell) => rows.lastChild.append(text(tag, cell)));
    };
    put(["track", "f [Hz]", "± 95 %", "damping [%]", "probability"], "th");
    data.tracks.forEach((name, k) => {
      if (data.frequencies[r][k] === null) return;
      const number = (value, digits) => (value === null ? "-" : Number(value.toPrecision(digits)));
      const damping = data.damping[r][k];
      put([name, number(data.frequencies[r][k], 6), number(data.halves[r][k], 2), number(damping === null ? null : 100 * damping, 3), number(data.probability[r][k], 3)], "td");
      if (k === track) rows.lastChild.style.fontWeight = "bold";
    });
    const bars = document.createElement("table"), shape = data.shapes && data.shapes[r][track];
    (shape || []).forEach((value, dof) => {
      const row = document.createElement("tr"), cell = document.createElement("td"), bar = document.createElement("div");
      bar.style.cssText = `height:.8em;width:${value === null ? 0 : 60 * Math.abs(value)}px;margin-left:${value < 0 ? 60 - 60 * Math.abs(value) : 60}px;background:${colour(track)}`;
      cell.append(bar);
      row.append(text("td", data.dofs[dof]), cell);
      bars.append(row);
    });
    panel.replaceChildren(text("p", `${data.names[r]}, ${when(data.times[r])} (UTC); shape of track ${data.tracks[track]}`), rows, bars);
  }

  function step(by) {
    const track = chosen ? chosen[1] : 0;
    for (let r = (chosen ? chosen[0] : -1) + by; r >= 0 && r < data.times.length; r += by)
      if (data.frequencies[r][track] !== null) return show([r, track]), true;
    return false;
  }
  const stop = () => { clearInterval(timer); timer = null; play.textContent = "play"; };
  play.addEventListener("click", () => {
    if (timer) return stop();
    play.textContent = "stop";
    timer = setInterval(() => step(1) || stop(), 120);
  });
  const at = (event) => [event.offsetX, event.offsetY];
  canvas.addEventListener("pointerdown", (event) => { drag = { from: at(event) }; canvas.setPointerCapture(event.pointerId); });
  canvas.addEventListener("pointermove", (event) => { if (drag) { drag.to = at(event); requestAnimationFrame(draw); } });
  canvas.addEventListener("pointerup", (event) => {
    const [from, to] = [drag.from, at(event)];
    drag = null;
    if (Math.hypot(to[0] - from[0], to[1] - from[1]) < 5) return show(nearest(...to));
    const [a, b] = [back(...from), back(...to)];
    view = { t: [Math.min(a[0], b[0]), Math.max(a[0], b[0])], f: [Math.min(a[1], b[1]), Math.max(a[1], b[1])] };
    paint();
  });
  canvas.addEventListener("dblclick", () => { view = all(); paint(); });
  canvas.addEventListener("keydown", (event) => {
    const by = { ArrowLeft: -1, ArrowRight: 1 }[event.key];
    if (by) { event.preventDefault(); step(by); }
  });
  addEventListener("resize", paint);
  paint();
})();
