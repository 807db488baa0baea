// Matrices of four rows, the last (0, 0, 0, 1), and vectors of three numbers.

export type Matrix4 = number[][];
export type Vector = number[];

export function product(a: Matrix4, b: Matrix4): Matrix4 {
  return a.map((row) =>
    [0, 1, 2, 3].map((column) => row.reduce((sum, value, k) => sum + value * b[k][column], 0)),
  );
}

export function applied(matrix: Matrix4, point: Vector): Vector {
  return [0, 1, 2].map(
    (row) => turned(matrix[row], point) + matrix[row][3],
  );
}

/** A vector, which has no place, in other axes. */
export function rotated(matrix: Matrix4, vector: Vector): Vector {
  return [0, 1, 2].map((row) => turned(matrix[row], vector));
}

function turned(row: number[], vector: Vector): number {
  return row[0] * vector[0] + row[1] * vector[1] + row[2] * vector[2];
}

export function affineInverse(matrix: Matrix4): Matrix4 {
  const [a, b, c] = matrix.map((row) => row.slice(0, 3));
  const cross = (p: Vector, q: Vector): Vector => [
    p[1] * q[2] - p[2] * q[1],
    p[2] * q[0] - p[0] * q[2],
    p[0] * q[1] - p[1] * q[0],
  ];
  const columns = [cross(b, c), cross(c, a), cross(a, b)];
  const determinant = turned(a, columns[0]);
  const linear = [0, 1, 2].map((row) => columns.map((column) => column[row] / determinant));
  const shift = [matrix[0][3], matrix[1][3], matrix[2][3]];
  return [...linear.map((row) => [...row, -turned(row, shift)]), [0, 0, 0, 1]];
}

/** Whether numbers of a file are a matrix that can be inverted. */
export function isAffine(matrix: unknown): matrix is Matrix4 {
  if (!Array.isArray(matrix) || matrix.length !== 4) return false;
  const isSmall = (value: unknown): boolean => typeof value === "number" && Math.abs(value) < 1e30;
  if (!matrix.every((row) => Array.isArray(row) && row.length === 4 && row.every(isSmall))) return false;
  const isLast = [0, 0, 0, 1].every((value, column) => matrix[3][column] === value);
  return isLast && affineInverse(matrix).flat().every((value) => Math.abs(value) < 1e30);
}

/** Whether numbers of a file are the corners of a box of cells. */
export function isBox(box: unknown): box is [Vector, Vector] {
  if (!Array.isArray(box) || box.length !== 2) return false;
  const isCell = (value: unknown): boolean => Number.isInteger(value) && Math.abs(value as number) < 2 ** 30;
  const [lower, upper] = box;
  const areCells = box.every((corner) => Array.isArray(corner) && corner.length === 3 && corner.every(isCell));
  return areCells && lower.every((low: number, axis: number) => low < upper[axis]);
}

export function plus(a: Vector, b: Vector, times = 1): Vector {
  return a.map((value, k) => value + times * b[k]);
}

export function scaled(a: Vector, times: number): Vector {
  return a.map((value) => value * times);
}

export function dot(a: Vector, b: Vector): number {
  return a.reduce((sum, value, k) => sum + value * b[k], 0);
}
