/** Optimal transport between few points, exactly, in steps between which a page can be drawn. */

/** The result of a computation that yields now and then. */
export function finish(steps) {
  let next = steps.next();
  while (!next.done) next = steps.next();
  return next.value;
}

/** A transport of least cost, by shortest augmenting paths; rows have equal supplies, and columns equal demands. */
export class Plan {
  constructor(rows, columns) {
    this.rows = rows;
    this.columns = columns;
    this.flow = new Int32Array(rows * columns);
    this.ofRow = new Float64Array(rows); // potentials
    this.ofColumn = new Float64Array(columns);
    this.distance = new Float64Array(rows); // of a path from the row that is served
    this.shortest = new Float64Array(columns);
    this.via = new Int32Array(rows); // the column before
    this.from = new Int32Array(columns); // the row before
    this.reached = new Uint8Array(rows);
    this.done = new Uint8Array(columns);
    this.queue = new Int32Array(rows);
    this.room = new Int32Array(columns);
  }

  /** Serve all rows, of no greater supply in sum than the demand; yields after each. */
  * solved(costs, n, m, supply, demand) {
    this.flow.fill(0, 0, n * m);
    this.ofRow.fill(0, 0, n);
    this.ofColumn.fill(0, 0, m);
    this.room.fill(demand, 0, m);
    for (let root = 0; root < n; root++) {
      for (let left = supply; left > 0;) left -= this.served(costs, n, m, root, left);
      yield;
    }
  }

  /** Send what the cheapest path can take, up to what is left; returns how much that is. */
  served(costs, n, m, root, left) {
    const { flow, ofRow, ofColumn, distance, shortest, via, from, reached, done, queue, room } = this;
    shortest.fill(Infinity, 0, m);
    done.fill(0, 0, m);
    reached.fill(0, 0, n);
    let [head, tail, lowest, end] = [0, 1, 0, -1];
    queue[0] = root;
    reached[root] = 1;
    distance[root] = 0;
    while (end < 0) {
      for (; head < tail; head++) {
        const i = queue[head];
        for (let j = 0; j < m; j++) {
          const length = lowest + costs[i * m + j] - ofRow[i] - ofColumn[j];
          if (!done[j] && length < shortest[j]) {
            shortest[j] = length;
            from[j] = i;
          }
        }
      }
      let next = -1;
      for (let j = 0; j < m; j++) {
        if (done[j]) continue;
        if (next < 0 || shortest[j] < shortest[next] || (shortest[j] === shortest[next] && room[j] > 0)) next = j;
      }
      lowest = shortest[next];
      done[next] = 1;
      if (room[next] > 0) end = next;
      else {
        for (let i = 0; i < n; i++) {
          if (reached[i] || !flow[i * m + next]) continue;
          reached[i] = 1;
          distance[i] = lowest;
          via[i] = next;
          queue[tail++] = i;
        }
      }
    }
    for (let k = 0; k < tail; k++) ofRow[queue[k]] += lowest - distance[queue[k]];
    for (let j = 0; j < m; j++) if (done[j]) ofColumn[j] -= lowest - shortest[j];
    let amount = Math.min(left, room[end]);
    for (let i = from[end]; i !== root; i = from[via[i]]) amount = Math.min(amount, flow[i * m + via[i]]);
    room[end] -= amount;
    for (let j = end; ; j = via[from[j]]) {
      const i = from[j];
      flow[i * m + j] += amount;
      if (i === root) return amount;
      flow[i * m + via[i]] -= amount;
    }
  }
}
