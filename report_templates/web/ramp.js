/** Colour of a departure, as t from -1 to 1: blue is inwards, red outwards. */
function rampColour(t) {
  const [blue, pale, white, rose, red] =
    [[33, 102, 172], [146, 197, 222], [247, 247, 247], [244, 165, 130], [178, 24, 43]];
  const size = Math.min(Math.abs(t), 1);
  const [middle, end] = t < 0 ? [pale, blue] : [rose, red];
  const [from, to, part] = size < 0.5 ? [white, middle, 2 * size] : [middle, end, 2 * size - 1];
  return `rgb(${from.map((one, i) => Math.round(one + part * (to[i] - one))).join(",")})`;
}
