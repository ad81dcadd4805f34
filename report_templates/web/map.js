// The wall that scans show, unrolled: a map of cells, and what the cell under the pointer says.

const HIDDEN_CELL = -32768;

{
  const box = document.getElementById("map");
  const data = box && dataOf("map");
  if (data) {
    box.hidden = false;
    runMap(box, data);
  }
}

function runMap(box, data) {
  const canvas = box.querySelector("canvas");
  const pen = canvas.getContext("2d");
  const slider = box.querySelector("#map-limit");
  const told = box.querySelector("#map-told");
  const tenths = unpacked(data.tenths, Int16Array);
  const azimuth = unpacked(data.azimuth_deg, Float32Array);
  const height = unpacked(data.height_m, Float32Array);
  const [columns, rows] = [data.columns, height.length - 1];
  const largest = tenths.reduce((most, one) => (one === HIDDEN_CELL ? most : Math.max(most, Math.abs(one))), 5) / 10;
  let cell = null; // [row, column] that is told

  const x = (degrees) => (canvas.width * degrees) / 360;
  const y = (metres) => canvas.height * (1 - (metres - height[0]) / (height[rows] - height[0]));
  const limit = () => largest * (data.limit_mm / largest) ** (2 * (1 - Number(slider.value) / 100));

  const draw = () => {
    canvas.width = Math.min(2000, Math.round(canvas.clientWidth * (window.devicePixelRatio || 1))) || 1;
    canvas.height = Math.round(canvas.width / 2.6);
    const full = limit();
    box.querySelector("#map-full").textContent = `${fixed(full, 1)}\u00a0mm`;
    pen.fillStyle = "rgb(150,156,164)";
    pen.fillRect(0, 0, canvas.width, canvas.height);
    for (let row = 0; row < rows; row += 1) {
      const [top, bottom] = [Math.floor(y(height[row + 1])), Math.ceil(y(height[row]))];
      for (let column = 0; column < columns; column += 1) {
        const value = tenths[row * columns + column];
        if (value === HIDDEN_CELL) continue;
        const [left, right] = [Math.floor(x(azimuth[column])), Math.ceil(x(azimuth[column + 1]))];
        pen.fillStyle = rampColour(value / 10 / full);
        pen.fillRect(left, top, right - left, bottom - top);
      }
    }
    pen.strokeStyle = "rgb(68,85,102)";
    pen.lineWidth = 1;
    for (const joint of data.joints_m) {
      pen.beginPath();
      pen.moveTo(0, y(joint));
      pen.lineTo(canvas.width, y(joint));
      pen.stroke();
    }
    pen.strokeStyle = "rgb(20,20,20)";
    pen.lineWidth = 2;
    for (const [from, to, low, high] of data.hidden) {
      pen.strokeRect(x(from), y(high), x(to) - x(from), y(low) - y(high));
    }
    if (cell) {
      const [row, column] = cell;
      pen.strokeStyle = "rgb(200,120,0)";
      pen.strokeRect(x(azimuth[column]), y(height[row + 1]),
        x(azimuth[column + 1]) - x(azimuth[column]), y(height[row]) - y(height[row + 1]));
    }
  };

  const tell = (found) => {
    cell = found;
    const [row, column] = cell;
    const value = tenths[row * columns + column];
    const middle = [(azimuth[column] + azimuth[column + 1]) / 2, (height[row] + height[row + 1]) / 2];
    const isHidden = value === HIDDEN_CELL;
    const by = data.hidden.find(([from, to, low, high]) =>
      isHidden && middle[0] >= from && middle[0] <= to && middle[1] >= low && middle[1] <= high);
    const text = sentence(isHidden ? "cloud_cell_hidden" : "cloud_cell", {
      azimuth: fixed(middle[0], 1), height: fixed(middle[1], 2), departure: fixed(value / 10, 1),
    });
    told.textContent = by ? `${text} (${by[4]}?)` : text;
    draw();
  };

  const placeOf = (edges, value) => {
    const after = edges.findIndex((edge) => edge > value);
    return after < 0 ? edges.length - 2 : Math.max(after - 1, 0);
  };
  canvas.addEventListener("pointermove", (event) => {
    const frame = canvas.getBoundingClientRect();
    const across = ((event.clientX - frame.left) / frame.width) * 360;
    const up = 1 - (event.clientY - frame.top) / frame.height;
    tell([placeOf(height, height[0] + up * (height[rows] - height[0])), placeOf(azimuth, across)]);
  });
  const moves = { ArrowLeft: [0, -1], ArrowRight: [0, 1], ArrowUp: [1, 0], ArrowDown: [-1, 0] };
  canvas.addEventListener("keydown", (event) => {
    const move = moves[event.key];
    if (!move || event.ctrlKey || event.metaKey) return;
    const [row, column] = cell ?? [0, -1];
    tell([
      Math.min(Math.max(row + move[0], 0), rows - 1), (column + move[1] + columns) % columns,
    ]);
    event.preventDefault();
  });
  slider.addEventListener("input", draw);
  lookChanged.push(draw);
  new ResizeObserver(draw).observe(canvas);
  draw();
}
