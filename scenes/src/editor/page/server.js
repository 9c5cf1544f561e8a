// Asking the server that a page came from. What goes wrong is thrown as an `Error` with the server's own line and its `status`.

export async function ask(method, path, question) {
  const options = { method };
  if (question !== undefined) {
    options.headers = { "Content-Type": "application/json" };
    options.body = JSON.stringify(question);
  }
  let response;
  try {
    response = await fetch(path, options);
  } catch {
    throw Object.assign(new Error("The page's server does not answer; is the program that serves it still running?"), { status: 0 });
  }
  const reply = await response.json().catch(() => ({}));
  if (!response.ok) {
    throw Object.assign(new Error(reply.error ?? `The server answered ${response.status}.`), { status: response.status });
  }
  return reply;
}

// One question under way at a time; of those that come meanwhile only the last is asked.
export class Latest {
  #running = false;
  #waiting = null;

  constructor(path, use, fail) {
    Object.assign(this, { path, use, fail });
  }

  ask(question, about) {
    this.#waiting = { question, about };
    if (!this.#running) this.#run();
  }

  async #run() {
    this.#running = true;
    while (this.#waiting) {
      const { question, about } = this.#waiting;
      this.#waiting = null;
      try {
        this.use(await ask("POST", this.path, question), about);
      } catch (error) {
        this.fail(error);
      }
    }
    this.#running = false;
  }
}
