// Requests of which only the newest counts, and bytes as text.

/** Sends one request at a time, and next the newest of those that came meanwhile: none is queued. */
function newestOf(send, receive) {
  let busy = false;
  let next = null;
  async function run() {
    let sent = null;
    const start = () => {
      if (next === null) return null;
      const body = next();
      next = null;
      return send(body).then((answer) => [body, answer], (error) => [body, { error: error.message }]);
    };
    for (sent = start(); sent !== null; ) {
      const [body, answer] = await sent;
      sent = start(); // on its way while this answer is drawn
      receive(answer, body);
      sent ??= start();
    }
  }
  return (body) => {
    next = body;
    if (busy) return;
    busy = true;
    run().finally(() => { busy = false; });
  };
}

/** Text of a file's bytes that JSON can hold. */
function base64(buffer) {
  const bytes = new Uint8Array(buffer);
  let text = "";
  for (let at = 0; at < bytes.length; at += 32768) text += String.fromCharCode(...bytes.subarray(at, at + 32768));
  return btoa(text);
}
