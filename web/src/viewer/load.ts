// Fetches a model stream and tells, piece by piece, what has arrived.
import { StreamDecoder, StreamError } from "./stream";

export interface LoadOptions {
  readonly url: string;
  readonly expectedBytes: number | null;
  readonly signal: AbortSignal;
  /** Called after every piece; the decoder's arrays hold all that is ready. */
  readonly onProgress: (decoder: StreamDecoder) => void;
}

export async function loadStream(options: LoadOptions): Promise<StreamDecoder> {
  const response = await fetch(options.url, { signal: options.signal, credentials: "same-origin" });
  if (!response.ok || response.body === null) throw new StreamError(`answer ${response.status}`);
  const decoder = new StreamDecoder(options.expectedBytes);
  const reader = response.body.getReader();
  try {
    for (;;) {
      const { done, value } = await reader.read();
      if (done) break;
      decoder.push(value);
      options.onProgress(decoder);
    }
    decoder.finish();
  } catch (error) {
    await reader.cancel().catch(() => undefined);
    throw error;
  }
  return decoder;
}
