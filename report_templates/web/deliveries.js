// The uncertainty of the volume between two dips, from the covariance factor of the table.

/** The covariance factor of the table: its columns at a height, their dof, and k. */
function covarianceOfTable(data, heights) {
  const kept = unpacked(data.rows, Uint32Array);
  const factor = unpacked(data.factor, Float32Array);
  const nodes = unpacked(data.k.inverse_dof, Float64Array);
  const logK = unpacked(data.k.log_k, Float64Array);

  /** Column of the factor at a height: straight between kept rows. */
  const columnsAt = (height) => {
    let upper = 1;
    let last = kept.length - 1;
    while (upper < last) {
      const middle = (upper + last) >> 1;
      if (heights[kept[middle]] < height) upper = middle + 1;
      else last = middle;
    }
    const [below, above] = [heights[kept[upper - 1]], heights[kept[upper]]];
    const part = (height - below) / (above - below);
    const at = (row, column) => factor[row * data.columns + column];
    return Array.from({ length: data.columns }, (_, column) =>
      (1 - part) * at(upper - 1, column) + part * at(upper, column));
  };

  /** k by its logarithm at Chebyshev's points of 1/dof (barycentric formula). */
  const coverage = (inverseDof) => {
    let above = 0;
    let below = 0;
    for (let i = 0; i < nodes.length; i++) {
      if (inverseDof === nodes[i]) return Math.exp(logK[i]);
      const half = i === 0 || i === nodes.length - 1 ? 0.5 : 1;
      const weight = ((i % 2 ? -1 : 1) * half) / (inverseDof - nodes[i]);
      above += weight * logK[i];
      below += weight;
    }
    return Math.exp(above / below);
  };

  /** Sum of squares of columns, and 1/dof by Welch-Satterthwaite. */
  const combine = (columns) => {
    const bySource = data.dof.map(() => 0);
    columns.forEach((value, column) => { bySource[data.source[column]] += value ** 2; });
    const variance = bySource.reduce((sum, value) => sum + value, 0);
    const quartic = bySource.reduce((sum, value, source) =>
      sum + (data.dof[source] === null ? 0 : value ** 2 / data.dof[source]), 0);
    const widest = data.k.least_dof === null ? 0 : 1 / data.k.least_dof;
    const inverse = variance > 0 ? Math.min(quartic / variance ** 2, widest) : 0;
    return { variance, inverse };
  };
  return { columnsAt, coverage, combine, inverseDof: (columns) => combine(columns).inverse };
}

/** A function (low, high) of two reads of the table to {u, k}; see tankcal/tank/deliveries.py. */
function deliveryUncertainty({ columnsAt, coverage, combine }) {
  return (low, high) => {
    const [one, other] = [columnsAt(low), columnsAt(high)];
    const { variance, inverse } = combine(one.map((value, column) => other[column] - value));
    return { u: Math.sqrt(variance), k: coverage(inverse) };
  };
}
