// The wall unrolled: its points by their residuals, rejected ones as crosses, one of them chosen.

{
  const box = document.getElementById("wall");
  const data = box && dataOf("wall");
  if (data) {
    box.hidden = false;
    runWall(box, data);
  }
}

function runWall(box, data) {
  const canvas = box.querySelector("canvas");
  const pen = canvas.getContext("2d");
  const told = box.querySelector("#wall-told");
  const [azimuths, heights, residuals] = ["azimuth_deg", "height_m", "residual_m"]
    .map((key) => unpacked(data[key], Float32Array));
  const joints = data.joints_m;
  const [low, high] = [joints[0], joints[joints.length - 1]];
  const limit = residuals.reduce((most, one) => Math.max(most, Math.abs(one)), 1e-4);
  const rejected = data.rejected;
  const used = data.names.map((name, i) => ({ name, azimuth: azimuths[i], height: heights[i], off_mm: 1000 * residuals[i] }));
  let chosen = null;

  const edge = () => 12 * (canvas.width / Math.max(canvas.clientWidth, 1));
  const x = (degrees) => edge() + ((canvas.width - 2 * edge()) * degrees) / 360;
  const y = (metres) => edge() + (canvas.height - 2 * edge()) * (1 - (metres - low) / (high - low));

  const dot = (one, size, colour) => {
    pen.beginPath();
    pen.arc(x(one.azimuth), y(one.height), size, 0, 2 * Math.PI);
    pen.fillStyle = colour;
    pen.fill();
    pen.strokeStyle = "rgb(68,85,102)";
    pen.lineWidth = 0.6;
    pen.stroke();
  };
  const cross = (one, size, colour) => {
    const [a, b] = [x(one.azimuth), y(one.height)];
    pen.strokeStyle = colour;
    pen.lineWidth = Math.max(1.5, size / 3);
    pen.beginPath();
    pen.moveTo(a - size, b - size);
    pen.lineTo(a + size, b + size);
    pen.moveTo(a - size, b + size);
    pen.lineTo(a + size, b - size);
    pen.stroke();
  };

  const draw = () => {
    const ratio = window.devicePixelRatio || 1;
    canvas.width = Math.min(2400, Math.round(canvas.clientWidth * ratio)) || 1;
    canvas.height = Math.round(canvas.width / 2.6);
    pen.fillStyle = "rgb(236,239,242)";
    pen.fillRect(0, 0, canvas.width, canvas.height);
    pen.strokeStyle = "rgb(140,150,160)";
    pen.lineWidth = 1;
    for (const joint of joints) {
      pen.beginPath();
      pen.moveTo(x(0), y(joint));
      pen.lineTo(x(360), y(joint));
      pen.stroke();
    }
    const size = (used.length > 1000 ? 2 : 3.5) * ratio;
    for (const one of used) dot(one, size, rampColour(one.off_mm / 1000 / limit));
    for (const one of rejected) cross(one, 4 * ratio, one.is_kept ? "rgb(20,110,60)" : "rgb(20,20,20)");
    if (chosen) {
      pen.strokeStyle = "rgb(200,100,0)";
      pen.lineWidth = 3 * ratio;
      pen.beginPath();
      pen.arc(x(chosen.azimuth), y(chosen.height), 9 * ratio, 0, 2 * Math.PI);
      pen.stroke();
    }
  };

  const look = (one) => {
    chosen = one;
    told.textContent = one === null ? "\u00a0" : sentence(one.reason ? "wall_rejected" : "wall_point", {
      point: one.name, azimuth: fixed(one.azimuth, 1), height: fixed(one.height, 3),
      off: fixed(one.off_mm, 1), reason: one.reason ?? "",
    });
    draw();
  };
  whenPointChosen((name) =>
    look(rejected.find((one) => one.name === name) ?? used.find((one) => one.name === name) ?? null));

  const nearest = (event) => {
    const frame = canvas.getBoundingClientRect();
    const scale = canvas.width / frame.width;
    const [a, b] = [(event.clientX - frame.left) * scale, (event.clientY - frame.top) * scale];
    const away = (one) => Math.hypot(x(one.azimuth) - a, y(one.height) - b);
    for (const some of [rejected, used]) {
      const best = some.reduce((found, one) => (found && away(found) <= away(one) ? found : one), null);
      if (best && away(best) < 14 * scale) return best;
    }
    return null;
  };
  canvas.addEventListener("click", (event) => {
    const found = nearest(event);
    if (found) choosePoint(found.name);
  });
  canvas.addEventListener("keydown", (event) => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step || !rejected.length || event.ctrlKey || event.metaKey) return;
    const at = rejected.indexOf(chosen);
    const next = at < 0 ? (step > 0 ? 0 : rejected.length - 1) : (at + step + rejected.length) % rejected.length;
    choosePoint(rejected[next].name);
    event.preventDefault();
  });
  lookChanged.push(draw);
  new ResizeObserver(draw).observe(canvas);
  draw();
}
