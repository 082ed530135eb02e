// The program under test and a running `qmpipe serve`, for tests in Node with or without a browser.

import assert from 'node:assert/strict';
import { execFileSync, spawn } from 'node:child_process';
import { once } from 'node:events';
import { createInterface } from 'node:readline';

export const program = process.env.QMPIPE_PROGRAM;
assert(program, 'QMPIPE_PROGRAM names the program to test');

export function run(command, ...args) {
  return execFileSync(command, args, { encoding: 'utf8', stdio: ['ignore', 'pipe', 'pipe'] });
}

export const qmpipe = (...args) => run(program, ...args);

// Serves a set, calls visit(address), and ends the server whatever happens.
export async function withServer(set, visit) {
  const server = spawn(program, ['serve', set, '--port', '0', '--json'],
                       { stdio: ['ignore', 'pipe', 'inherit'] });
  try {
    const lines = createInterface({ input: server.stdout });
    const [line] = await Promise.race([
      once(lines, 'line'),
      once(server, 'exit').then(([code]) => { throw new Error(`serve ended with ${code}`); }),
    ]);
    const said = JSON.parse(line);
    await visit(said.viewer, said);
  } finally {
    const ended = server.exitCode === null ? once(server, 'exit') : [server.exitCode];
    server.kill('SIGINT');
    const [code] = await ended;
    assert.equal(code, 0, 'the server ends with exit code 0 on an interrupt');
  }
}
